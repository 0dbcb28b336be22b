"""Records of bridges in the audit log."""
