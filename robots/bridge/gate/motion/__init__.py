"""How much of a twist is safe: braking, corridors, restraint and the played-out stop."""
