"""Notifications and calendar feeds."""
