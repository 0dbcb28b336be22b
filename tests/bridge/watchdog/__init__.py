"""Rules and socket of the watchdog."""
