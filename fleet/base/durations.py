"""Durations as text that needs no translation."""

from __future__ import annotations


def duration_text(seconds: float) -> str:
    """Return seconds as hours:minutes:seconds, such as 0:05:07 or 31:00:00."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
