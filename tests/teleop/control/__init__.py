"""Rules and leases of control."""
