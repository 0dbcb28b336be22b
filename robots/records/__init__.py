"""Writes reports of bridges into the audit log."""
