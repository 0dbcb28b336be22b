"""Masters, nodes and connections that fail, send false data or send too much."""
