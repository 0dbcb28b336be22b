"""The cost of many robots, pages, people and records: the table of growth, each goal as a limit."""
