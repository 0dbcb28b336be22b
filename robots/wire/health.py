"""The robot's health as its own nodes report it."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

# As in ROS's diagnostics; silent: it said so of itself, or has said nothing for 10 s.
HealthLevel = Literal["ok", "silent", "warning", "error"]


class HealthPart(Struct, frozen=True):
    """A part that is not well, in the words of the node that reports it.

    One that was ill and fell silent keeps its level, and `text` says so: silence is no improvement.
    """

    name: str
    level: HealthLevel
    text: str
    since_s: int  # so long at this level


class Temperature(Struct, frozen=True):
    """A temperature that a part reports."""

    name: str
    celsius: int


class Health(Struct, frozen=True):
    """The summary of the robot's diagnostics. `level` is that of the worst part."""

    level: HealthLevel
    parts: list[
        HealthPart
    ]  # at most 8 that are not well, the newest among them; the worst first, then the oldest
    parts_more: int  # further parts that are not well
    well: int  # number of parts
    temperatures: list[Temperature]  # at most 6, the hottest first
    left_out: int = 0  # parts beyond the first 200
    unread: int = 0  # reports without a name, or with an unknown level
