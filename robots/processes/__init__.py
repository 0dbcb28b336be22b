"""For every process of the console: real-time priority and orderly shutdown."""
