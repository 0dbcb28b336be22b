"""How long something took, in words that take no translation."""

from __future__ import annotations


def clock(seconds: float) -> str:
    """Hours, minutes and seconds, such as 0:05:07 or 31:00:00."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"
