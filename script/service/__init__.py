"""What makes `script/serve` a good service: it keeps its processes running, and tells systemd when they are ready."""
