"""Leases at the bridge: grants, fencing numbers, and the state that survives a restart."""
