"""For all processes of the console: real-time priority, orderly shutdown, counts of durations."""
