"""A robot's processes cannot start: this computer lacks something that they need."""

from __future__ import annotations


class Unready(Exception):
    """The missing part and its remedy, in words."""
