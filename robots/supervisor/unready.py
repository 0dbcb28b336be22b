"""A robot's processes cannot start: this computer lacks something that they need."""

from __future__ import annotations


class Unready(Exception):
    """What is missing, and what to do, in words."""
