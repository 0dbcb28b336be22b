"""Direction of the head: turned by its holder, ahead on request and, if configured, into the turn of a drive.

After the holder has turned the head, the head keeps this direction until somebody asks it to look ahead. To
look ahead, it first looks down as far as it can: the depth camera then shows which obstacles near the robot
are still there.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from robots.shared.configuration.bridge_config import HeadSource
from robots.shared.geometry.poses import Velocity

AHEAD_TAKES_S = 1.5
DOWN_S = 0.8  # time for two pictures of a slow camera and their delay: they show which space is free
MIDDLE_S = 0.4
UP_S = 0.8  # slow enough for the depth camera, see FOLLOW_RADPS
FOLLOW_EVERY_S = 0.2
# the head looks where the robot will be after this time: the robot can stop from any speed within it
FOREKNOWLEDGE_S = 1.5
FOLLOW_RAD = 0.3  # at a larger angle, the way straight ahead is outside the camera's picture
FOLLOW_RADPS = 0.4  # above 0.5 rad/s of the head, the gate ignores depth frames
LEAST_RAD = 0.03
REPEAT_S = 2.0  # send again: a motion or another node may have turned the head
DRIVING_MPS = 0.05
TURN_RADPS = 1.2  # for turns by the holder; TIAGo's head can do 3
TURN_LEAST_S = 0.2
ARRIVED_S = 2.0  # this long after the holder's last turn, joint states give the position, not the last aim


FAR_M = 1000.0  # a point at this distance lies in the same direction from the head and from the base


class Aim(NamedTuple):
    """Joint positions (radians; positive: left, up) and the seconds for the way there."""

    pan: float
    tilt: float
    seconds: float

    @property
    def point(self) -> tuple[float, float, float]:
        """A point in this direction, as seen from the base (m)."""
        across = FAR_M * math.cos(self.tilt)
        return across * math.cos(self.pan), across * math.sin(self.pan), FAR_M * math.sin(self.tilt)


class Head:
    """One robot's head: the last commanded position, and who commanded it."""

    def __init__(self, source: HeadSource) -> None:
        self._source = source
        self._pan = self._tilt = 0.0
        self._by_hand = False
        self._sent_s = -math.inf
        self._turned_s = -math.inf  # last turn by the holder
        self._arrives_s = -math.inf  # when the head has completed this turn
        self._forward_s = -math.inf  # when the head was last sent ahead for a drive to a place
        self._next: deque[tuple[float, Aim]] = deque()  # remaining steps of looking ahead, with times

    def ahead(self, aside: float | None, now_s: float) -> Aim:
        """Return the first aim of looking ahead: as far down as possible, and `aside` (pan in radians).

        `onward` returns the next aims: slowly to the middle, then up to the floor in front of the robot.
        """
        lowest = min(self._source.tilt_rad[0], self._source.look_tilt)
        pan = _within(aside or 0.0, self._source.pan_rad)
        at_s = now_s + AHEAD_TAKES_S + DOWN_S
        self._next.clear()
        if pan:
            sweeps_s = abs(pan) / FOLLOW_RADPS
            self._next.append((at_s, Aim(0.0, lowest, sweeps_s)))
            at_s += sweeps_s + MIDDLE_S
        self._next.append((at_s, Aim(0.0, self._source.look_tilt, UP_S)))
        self._pan, self._tilt, self._sent_s = pan, lowest, at_s + UP_S
        self._by_hand = False
        self._turned_s = self._forward_s = -math.inf
        return Aim(pan, lowest, AHEAD_TAKES_S)

    def forward(self, now_s: float) -> Aim | None:
        """Return the aim at the floor in front of the robot; None if it was returned a moment ago."""
        if now_s - self._forward_s < REPEAT_S:
            return None
        self._forward_s = now_s
        self._next.clear()
        self._pan, self._tilt, self._sent_s = 0.0, self._source.look_tilt, now_s + AHEAD_TAKES_S
        self._by_hand = False
        self._turned_s = -math.inf
        return Aim(0.0, self._source.look_tilt, AHEAD_TAKES_S)

    def stay(self) -> None:
        """Drop the remaining steps of looking ahead: the requester lost control, or the robot was stopped."""
        self._next.clear()

    def onward(self, now_s: float) -> Aim | None:
        """Return the next aim of looking ahead, once, when it is due."""
        if not self._next or now_s < self._next[0][0]:
            return None
        _, aim = self._next.popleft()
        self._pan, self._tilt, _ = aim
        return aim

    def turn(
        self,
        pan: float,
        tilt: float,
        at: tuple[float, float] | None,
        now_s: float,
        *,
        absolute: bool = False,
        here: bool = False,
    ) -> Aim:
        """Return the aim after a turn by these angles (radians; positive: left, up), within the limits.

        `absolute`: after a turn to these angles. `here`: after one from the head's position.

        The first turn starts from the head's position (`at`: pan and tilt; None: unknown), because a motion
        or another node may have moved the head. The next turns of a drag start from the last aim: the head
        may not have reached it yet. The seconds are for the whole remaining way, because many turns may
        arrive at once.
        """
        is_first = now_s - self._turned_s > ARRIVED_S
        if at is not None and (is_first or here):
            self._pan, self._tilt = at
        self._turned_s, self._forward_s = now_s, -math.inf
        self._next.clear()
        before = self._pan, self._tilt
        if absolute:
            self._pan = self._tilt = 0.0
        self._pan = _within(self._pan + pan, self._source.pan_rad)
        self._tilt = _within(self._tilt + tilt, self._source.tilt_rad)
        self._by_hand = True
        start, open_s = (at, 0.0) if at is not None else (before, self._open_s(is_first, now_s))
        farthest = max(abs(self._pan - start[0]), abs(self._tilt - start[1]))
        seconds = max(open_s + farthest / TURN_RADPS, TURN_LEAST_S)
        self._arrives_s = now_s + seconds
        return Aim(self._pan, self._tilt, seconds)

    def _open_s(self, is_first: bool, now_s: float) -> float:
        """Return the seconds until a head of unknown position reaches its last aim.

        Before a first turn, the head may be anywhere.
        """
        if not is_first:
            return max(self._arrives_s - now_s, 0.0)
        return max(high - low for low, high in (self._source.pan_rad, self._source.tilt_rad)) / TURN_RADPS

    def follow(self, velocity: Velocity, now_s: float) -> Aim | None:
        """Return the next aim for a drive with this velocity; None: do not move the head."""
        driving = velocity.vx > DRIVING_MPS
        if (
            self._by_hand
            or not (self._source.follows_turn and driving)
            or now_s - self._sent_s < FOLLOW_EVERY_S
        ):
            return None
        wanted = min(max(velocity.w * FOREKNOWLEDGE_S / 2.0, -FOLLOW_RAD), FOLLOW_RAD)
        if abs(wanted - self._pan) < LEAST_RAD:
            return self._again(now_s)
        step = FOLLOW_RADPS * FOLLOW_EVERY_S
        self._pan += min(max(wanted - self._pan, -step), step)
        self._tilt, self._sent_s = self._source.look_tilt, now_s
        return Aim(self._pan, self._source.look_tilt, FOLLOW_EVERY_S)

    def _again(self, now_s: float) -> Aim | None:
        """Repeat the last aim every `REPEAT_S`, slowly: the head may be anywhere."""
        if now_s - self._sent_s < REPEAT_S:
            return None
        self._sent_s = now_s
        return Aim(self._pan, self._source.look_tilt, AHEAD_TAKES_S)


def _within(value: float, limits: tuple[float, float]) -> float:
    return min(max(value, limits[0]), limits[1])
