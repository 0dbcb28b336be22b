"""Writes what bridges report into the audit log."""
