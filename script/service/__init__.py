"""The parts that make `script/serve` a good service: it keeps its processes running, and tells systemd about them."""
