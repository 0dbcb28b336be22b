"""Joints above the base: table, frames, recorded motions and trajectories."""
