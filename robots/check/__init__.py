"""Checks a robot before its first drive: the page, and the work of `manage.py check_robot`."""
