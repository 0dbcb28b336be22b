"""Hours on robots, added up: booked, used and not shown; left of each quota."""
