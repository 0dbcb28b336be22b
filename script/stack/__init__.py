"""Runs all processes of the console together, for script/demo, script/serve, browser tests and benchmarks."""
