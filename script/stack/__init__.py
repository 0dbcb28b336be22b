"""The console's processes together: for script/demo, script/serve, browser tests, benchmarks."""
