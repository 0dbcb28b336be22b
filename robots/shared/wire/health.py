"""The robot's health, as the robot's own nodes report it."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from robots.shared.wire.base import Worded

# Levels of ROS diagnostics. silent: the part's report is marked as stale, or no report came for 10 s.
HealthLevel = Literal["ok", "silent", "warning", "error"]


class HealthPart(Worded, frozen=True):
    """A part that is not well, in the words of the node that reports it.

    A part that was not well and then sends no reports keeps its level, and `text` says so: silence is no improvement.
    """

    name: str
    level: HealthLevel
    text: str
    since_s: int  # time at this level


class Temperature(Struct, frozen=True):
    """A temperature of a part."""

    name: str
    celsius: int


class Health(Struct, frozen=True):
    """The summary of the robot's diagnostics. `level` is the level of the worst part."""

    level: HealthLevel
    # At most 8 that are not well, always with the newest; the worst first, among equals the oldest
    parts: list[HealthPart]
    parts_more: int  # further parts that are not well
    well: int  # number of parts
    temperatures: list[Temperature]  # at most 6, the hottest first
    left_out: int = 0  # parts beyond the first 200, and parts with more than 8 reporters
    unread: int = 0  # reports without a name, or with an unknown level
