"""Conclusions of the bridge from the publishers and listeners of a robot."""
