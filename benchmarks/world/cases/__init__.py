"""Cases that judge the gate: a world, a robot, a driver, and the figures of many runs."""
