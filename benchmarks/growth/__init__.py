"""What many robots, pages, people and records cost: the table of growth, each goal as a limit."""
