"""A visitor of a robot: a plain program of each ROS that tests drive. `tests.sides.visitor` speaks with it."""
