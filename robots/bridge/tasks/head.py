"""Where the head looks: ahead when the holder asks, and, if configured, into the turn of a drive."""

from __future__ import annotations

import math
from typing import NamedTuple

from robots.bridge.config import HeadSource
from robots.bridge.gate.values import Velocity

AHEAD_TAKES_S = 1.5
FOLLOW_EVERY_S = 0.2
# the head looks where the robot will be after this time: the robot can stop from any speed within it
FOREKNOWLEDGE_S = 1.5
FOLLOW_RAD = 0.3  # beyond it, the way straight ahead leaves the camera's picture
FOLLOW_RADPS = 0.4  # above 0.5 rad/s of the head, the gate ignores depth frames
LEAST_RAD = 0.03
SAID_AGAIN_S = 2.0  # send again: a motion or another node may have turned the head
DRIVING_MPS = 0.05


class Aim(NamedTuple):
    """Joint positions (radians; positive: left, up) and the seconds for the way there."""

    pan: float
    tilt: float
    seconds: float


class Head:
    """One robot's head. `pan` is the last commanded position."""

    def __init__(self, source: HeadSource) -> None:
        self._source = source
        self._pan = 0.0
        self._sent_s = -math.inf

    def ahead(self, now_s: float) -> Aim:
        """Return the aim straight ahead, and down to where the floor in front of the robot is in view."""
        self._pan, self._sent_s = 0.0, now_s + AHEAD_TAKES_S
        return Aim(0.0, self._source.look_tilt, AHEAD_TAKES_S)

    def follow(self, velocity: Velocity, now_s: float) -> Aim | None:
        """Return the next aim for a drive with this velocity; None to leave the head where it is."""
        driving = velocity.vx > DRIVING_MPS
        if not (self._source.follows_turn and driving) or now_s - self._sent_s < FOLLOW_EVERY_S:
            return None
        wanted = min(max(velocity.w * FOREKNOWLEDGE_S / 2.0, -FOLLOW_RAD), FOLLOW_RAD)
        if abs(wanted - self._pan) < LEAST_RAD:
            return self._again(now_s)
        step = FOLLOW_RADPS * FOLLOW_EVERY_S
        self._pan += min(max(wanted - self._pan, -step), step)
        self._sent_s = now_s
        return Aim(self._pan, self._source.look_tilt, FOLLOW_EVERY_S)

    def _again(self, now_s: float) -> Aim | None:
        """Repeat the last aim now and then, slowly: the head may be anywhere."""
        if now_s - self._sent_s < SAID_AGAIN_S:
            return None
        self._sent_s = now_s
        return Aim(self._pan, self._source.look_tilt, AHEAD_TAKES_S)
