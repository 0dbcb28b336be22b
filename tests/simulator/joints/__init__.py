"""Joints of the simulated robot: arm, head, motions, trajectories."""
