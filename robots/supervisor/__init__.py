"""The fleet supervisor (`manage.py run_fleet`): starts and restarts the bridge and the watchdog of each robot."""
