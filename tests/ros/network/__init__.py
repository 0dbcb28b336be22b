"""Masters, nodes and connections that fail, lie or flood."""
