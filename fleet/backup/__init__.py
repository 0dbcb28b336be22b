"""Backups: one archive of the console, its way back, and the check that it can come back."""
