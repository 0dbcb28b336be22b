"""Lease, fence and stop latch at the bridge, and the state file that survives a restart."""
