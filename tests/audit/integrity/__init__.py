"""Protection of the audit log: triggers, chain, verification, index check."""
