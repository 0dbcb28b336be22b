"""The fleet supervisor (`manage.py run_fleet`): starts the bridge and the watchdog of each robot, and restarts them."""
