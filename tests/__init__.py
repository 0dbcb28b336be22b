"""All tests: a folder for each app or process; `drives/`, `ros/`, `script/` and `browser/` test several together."""
