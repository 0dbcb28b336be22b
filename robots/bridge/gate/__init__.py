"""The safety gate: decides how much of a twist the robot may execute. Pure: numpy only."""
