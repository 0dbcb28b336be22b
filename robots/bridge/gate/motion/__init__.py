"""The safe share of a twist: braking, corridors, restraint and roll-out."""
