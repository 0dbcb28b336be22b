"""For every process of the console: real-time priority, orderly shutdown, counted durations."""
