"""Hours on robots, added up: booked and used, slots not used; left of each quota."""
