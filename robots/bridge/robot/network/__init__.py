"""What the bridge concludes from the publishers and listeners of a robot."""
