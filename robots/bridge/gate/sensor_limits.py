"""Speed limits from the state and view of the sensors; limits from obstacles are elsewhere (docs/gate.md, 9).

A `Fault` is missing data that forbids any motion; a `SpeedLimit` allows motion up to a speed.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

from robots.bridge.gate import words
from robots.bridge.gate.arm import discs as arm_discs
from robots.bridge.gate.motion import braking
from robots.bridge.gate.obstacles.depth_camera import DepthCamera
from robots.bridge.gate.obstacles.sources import Laser, Sonar
from robots.bridge.gate.sensing.sectors import gaps_between
from robots.bridge.gate.timing.freshness import (
    DEPTH_STALE_S,
    LASER_HALT_S,
    LASER_LATE_S,
    LASER_STALE_S,
    ODOMETRY_STALE_S,
    SONAR_STALE_MPS,
    SONAR_STALE_S,
    Freshness,
)
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import Sector
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry import arc
from robots.shared.geometry.footprint import Footprint
from robots.shared.geometry.poses import Velocity
from robots.shared.records.verdict import SpeedLimit, Way
from robots.shared.sentences import Sentence, joined, say

REVERSE_RAD = 0.75 * math.pi  # directions beyond this angle count as reverse
CAMERA_LATE_S = 0.5  # if a person drives by a camera picture that is older, the speed is limited
FELT_SHARE = 0.95  # of the top speed: nobody feels a limit above
THE_ROBOT, THE_PAGE = say("the robot answers"), say("the page answers")
THE_CAMERA = say("the camera’s picture comes")
AHEAD = Velocity(1.0, 0.0, 0.0)
ABOVE_MPS = 0.03  # a robot that obeys a limit may exceed it briefly by this much
ALONG = (0.0, math.pi)  # the directions of a differential base
EVERY_WAY = (*ALONG, math.pi / 2.0, -math.pi / 2.0)
AROUND = tuple(math.radians(degrees) for degrees in range(0, 360, 30))


class Fault(NamedTuple):
    """Missing data that forbids motion: a verdict's code, words, and the source's name."""

    code: str
    text: str
    sensor: str


class LimitedTwist(NamedTuple):
    """A twist within all speed limits, with code, words and way of the last limit that reduced it."""

    velocity: Velocity
    code: str
    text: str
    way: Way | None = None


class SensorLimits:
    """Speed limits from a robot's sensors, arm and latency."""

    def __init__(
        self,
        profile: GateProfile,
        odometry: Freshness,
        trail: Trail,
        lasers: Collection[Laser],
        sonars: Collection[Sonar],
        depth: DepthCamera | None,
    ) -> None:
        self.operator_delay_s: float | None = None  # round trip to the page; None: unknown
        self.camera_view_s: float | None = None  # age of the picture by which the operator drives
        self.lost_limb: str | None = None  # a limb that may move without joint states
        self._profile = profile
        self._odometry = odometry
        self._trail = trail
        self._lasers = lasers
        self._sonars = sonars
        self._depth = depth
        self._posture = arm_discs.UNKNOWN
        self._posture_s = -math.inf
        # its reach, and the time of the last motion
        self._arm_moved: tuple[arm_discs.Disc, float] | None = None

    def observe_posture(self, arm: arm_discs.Posture, arrival_s: float) -> None:
        self._posture, self._posture_s = arm, arrival_s
        if arm.reach is not None:
            self._arm_moved = arm.reach, arrival_s

    def arm_reach(self, now_s: float) -> arm_discs.Disc | None:
        """Return the disc in which a depth point may be the arm; None if the arm is at a known place and still.

        The arm may be anywhere in its reach while it moves, shortly after, and while its posture is unknown.
        """
        if not self._profile.has_arm:
            return None
        arm = self._posture
        if now_s - self._posture_s > arm_discs.KNOWN_S or not (arm.at_home or arm.discs is not None):
            return arm.reach or arm_discs.ANYWHERE
        if self._arm_moved and now_s - self._arm_moved[1] <= arm_discs.LATELY_S:
            return self._arm_moved[0]
        return None

    def forget_posture(self) -> None:
        """Treat the arm's posture as unknown."""
        self._posture, self._posture_s = arm_discs.UNKNOWN, -math.inf

    def fault(self, now_s: float) -> Fault | None:
        """Return the missing data that forbids motion, if any."""
        age_s = self._odometry.age_s(now_s)
        if age_s is None:
            return Fault("odometry_missing", say("no odometry has come yet"), "odometry")
        if age_s > ODOMETRY_STALE_S:
            return Fault("odometry_stale", say("odometry is {age:age} old", age=age_s), "odometry")
        for laser in self._lasers:
            age_s = laser.freshness.age_s(now_s)
            if age_s is None:
                return Fault(
                    "scan_missing", say("no scan of the {sensor} has come yet", sensor=laser.word), laser.name
                )
            if age_s >= LASER_STALE_S:
                return Fault(
                    "scan_stale",
                    say("{sensor} is {age:age} old", sensor=laser.word, age=age_s),
                    laser.name,
                )
            if not laser.is_paired(self._trail):
                text = say("the stamps of the {sensor} do not match the odometry’s", sensor=laser.word)
                return Fault("scan_unpaired", text, laser.name)
        return None

    def everywhere(self, latency_s: float, slow_clock: float | None, now_s: float) -> list[SpeedLimit]:
        """Return the limits for every direction, for a robot with this latency (s) and pace of its clock."""
        return [*self._arm_limit(now_s), *self._delay_limits(latency_s, slow_clock)]

    def of_any_command(self, everywhere: list[SpeedLimit], now_s: float) -> tuple[SpeedLimit, ...]:
        """Return all limits that are independent of the command: those `everywhere` and those of each direction."""
        ways = ALONG if self._profile.limits.lateral_mps == 0.0 else EVERY_WAY
        by_way = [limit for direction in ways for limit in self._direction_limit(direction, now_s)]
        return (*everywhere, *self._depth_limit(AHEAD, now_s), *by_way)

    def limited(
        self,
        asked: Velocity,
        possible: Velocity,
        everywhere: list[SpeedLimit],
        footprint: Footprint,
        now_s: float,
    ) -> LimitedTwist:
        """Limit the `possible` part of `asked`, for a robot with this footprint."""
        left = LimitedTwist(possible, "free", "")
        if possible != asked:
            left = LimitedTwist(possible, "robot_limit", say("limited to the robot’s maximum speed"))
        speed = arc.speed(possible)
        if speed > 0.0:
            direction = math.atan2(possible.vy, possible.vx)
            limits = [
                *everywhere,
                *self._depth_limit(possible, now_s),
                *self._direction_limit(direction, now_s),
            ]
            limit = min(limits, key=lambda limit: limit.mps, default=None)
            if limit is not None and limit.mps < speed:
                left = LimitedTwist(possible.scaled(limit.mps / speed), limit.code, limit.text, limit.way)
        swing = abs(left.velocity.w) * footprint.reach(0.0)
        if swing > self._profile.blind_mps and self._swings_unwatched(footprint):
            slowed = left.velocity.scaled(self._profile.blind_mps / swing)
            text = say(
                "turning at most {speed:fine} rad/s: no sensor sees where the robot’s corners move",
                speed=abs(slowed.w),
            )
            left = LimitedTwist(slowed, "blind_direction", text, "turn")
        for laser, age_s in self.late_lasers(now_s):
            slowed = left.velocity.scaled(late_share(age_s))
            old = say("{sensor} is {age:age} old", sensor=laser.word, age=age_s)
            text = joined(": ", [words.reduction(left.velocity, slowed), old])
            left = LimitedTwist(slowed, "scan_late", text)
        return left

    def late_lasers(self, now_s: float) -> list[tuple[Laser, float]]:
        """Return the lasers whose newest scan slows the robot because of its age, with this age (s)."""
        ages = [(laser, laser.freshness.age_s(now_s) or 0.0) for laser in self._lasers]
        return [(laser, age_s) for laser, age_s in ages if age_s > LASER_LATE_S]

    def unwatched(self, moving: Velocity, now_s: float) -> SpeedLimit | None:
        """Return the lowest limit for a way that no sensor watches, if this velocity exceeds one; else None.

        A way that bends out of the depth picture does not count: the camera sees its beginning.
        """
        mps = arc.speed(moving)
        if mps == 0.0:
            return None
        limits = self._direction_limit(math.atan2(moving.vy, moving.vx), now_s)
        if self._depth is not None:
            limits += self._depth_limit(moving, now_s)
        exceeded = [limit for limit in limits if limit.way != "bend" and mps > limit.mps + ABOVE_MPS]
        return min(exceeded, key=lambda limit: limit.mps, default=None)

    def looks_ahead(self, moving: Velocity, now_s: float) -> bool:
        """Return whether a fresh depth picture shows the way of a robot with this velocity.

        If the robot stands or reverses, the way ahead counts: no head turns far enough for reverse. True
        without a depth camera.
        """
        if self._depth is None:
            return True
        direction = math.atan2(moving.vy, moving.vx) if arc.speed(moving) > ABOVE_MPS else 0.0
        if abs(direction) > REVERSE_RAD:
            direction = 0.0
        return self._depth.is_fresh(now_s) and self._depth.sight_m(direction, 0.0) > 0.0

    def _arm_limit(self, now_s: float) -> list[SpeedLimit]:
        """Return the limit while the arm's posture is unknown, or a limb may move without joint states."""
        if self.lost_limb:
            limb = words.LIMBS[self.lost_limb]
            why = say("the {limb} may still move, because its joint states ended", limb=limb)
            return [_limit("arm_away", why, arm_discs.AWAY_MPS)]
        is_recent = now_s - self._posture_s <= arm_discs.KNOWN_S
        known = is_recent and (self._posture.at_home or self._posture.discs is not None)
        if known or not self._profile.has_arm:
            return []
        why = say("the arm is away from home") if is_recent else say("the arm’s position is not known")
        return [_limit("arm_away", why, arm_discs.AWAY_MPS)]

    def _delay_limits(self, latency_s: float, slow_clock: float | None) -> list[SpeedLimit]:
        """Return the limits for a late robot, page or camera picture, for the usual stopping distance.

        A speed that is hardly below the top speed is no limit. Stops before obstacles count the latency in full anyway.
        """
        parameters, full_mps = self._profile.parameters, self._profile.limits.forward_mps
        linear, _ = braking.deceleration(self._profile)
        limits = []
        camera_s = self.camera_view_s or 0.0
        page_s = self.operator_delay_s or 0.0
        for code, delay_s, assumed_s, who in (
            ("robot_late", latency_s, parameters.latency_s, THE_ROBOT),
            ("operator_late", page_s, parameters.operator_delay_s, THE_PAGE),
            ("camera_late", camera_s, CAMERA_LATE_S, THE_CAMERA),
        ):
            mps = braking.speed_for(delay_s, full_mps, assumed_s, linear)
            if mps >= FELT_SHARE * full_mps:
                continue
            why = say("{late} after {delay:.2f} s", late=who, delay=delay_s)
            if code == "robot_late" and slow_clock is not None:
                why = say(
                    "{late} by its clock, which runs at {pace:.2f} of our pace (simulated? set use_sim_time)",
                    late=why,
                    pace=slow_clock,
                )
            limits.append(_limit(code, why, mps))
        return limits

    def _depth_limit(self, wanted: Velocity, now_s: float) -> list[SpeedLimit]:
        """Return the limit for a way outside the depth picture: table tops on it may be unknown."""
        if not self._profile.has_depth:
            return []
        age_s = self._depth.freshness.age_s(now_s) if self._depth else None
        if self._depth is None:
            unused = say("the depth camera is not in use yet: the robot cannot see table tops")
            return [self._blind("depth_missing", unused)]
        if age_s is None:
            why = self._complained(say("no picture of the depth camera has come yet"))
            return [self._blind("depth_missing", why)]
        if age_s > DEPTH_STALE_S:
            why = self._complained(say("the depth camera’s picture is {age:age} old", age=age_s))
            return [self._blind("depth_stale", why)]
        return self._head_limit(self._depth, wanted)

    def _complained(self, why: Sentence) -> Sentence:
        """Return a reason with the depth camera's complaint, if it has one."""
        if self._depth is None or not self._depth.complaint:
            return why
        return say("{why} ({more})", why=why, more=self._depth.complaint)

    def _head_limit(self, depth: DepthCamera, wanted: Velocity) -> list[SpeedLimit]:
        """Return the limit for a way that leaves the depth picture; none in reverse: no head turns so far."""
        direction = math.atan2(wanted.vy, wanted.vx)
        if abs(direction) > REVERSE_RAD:
            return []
        sight_m = depth.sight_m(direction, wanted.w / arc.speed(wanted))
        if sight_m == 0.0:
            return [self._blind("head_away", say("the depth camera looks away from the way ahead"))]
        if math.isinf(sight_m):
            return []
        linear, _ = braking.deceleration(self._profile)
        mps = max(
            braking.speed_within(sight_m, self._profile.parameters.latency_s, linear), self._profile.blind_mps
        )
        bends = say("the way bends out of the depth camera’s view")
        return [SpeedLimit("head_away", words.at_most(mps, bends), mps, "bend")]

    def _blind(self, code: str, why: Sentence) -> SpeedLimit:
        return _limit(code, why, self._profile.blind_mps)

    def _swings_unwatched(self, footprint: Footprint) -> bool:
        """Return whether a turn moves corners to a place without laser and sonar. A disc has no corners."""
        if footprint.turns_freely:
            return False
        return any(
            not any(sensor.covers(direction) for sensor in self._lasers)
            and not any(sensor.watches(direction) for sensor in self._sonars)
            for direction in AROUND
        )

    def _fastest(self, way: Way) -> float:
        limits = self._profile.limits
        if way in ("forward", "reverse"):
            return limits.forward_mps if way == "forward" else limits.reverse_mps
        return limits.lateral_mps

    def unseen(self, now_s: float) -> list[Sector]:
        """Return the sectors around the base without laser and sonar."""
        heard = [sonar.sector for sonar in self._sonars if sonar.freshness.within(SONAR_STALE_S, now_s)]
        lasers = [laser.sector for laser in self._lasers if laser.freshness.within(LASER_STALE_S, now_s)]
        return gaps_between([*heard, *(sector for sector in lasers if sector is not None)])

    def _direction_limit(self, direction: float, now_s: float) -> list[SpeedLimit]:
        """Return the limit for a direction of travel that no laser watches."""
        if any(laser.covers(direction) for laser in self._lasers):
            return []
        sonars = [sonar for sonar in self._sonars if sonar.watches(direction)]
        way, in_words = words.way(direction)
        if not sonars:
            mps = self._profile.blind_mps
            text = words.at_most(mps, say("no sensor looks there"), in_words)
            return [SpeedLimit("blind_direction", text, mps, way)]
        mps = min(self._profile.parameters.between_sonars_mps, self._profile.blind_mps)
        silent = [sonar for sonar in sonars if not sonar.freshness.within(SONAR_STALE_S, now_s)]
        if not silent and mps >= self._fastest(way):
            return []
        if not silent:
            text = words.at_most(mps, say("no sensor looks between and above the sonars"), in_words)
            return [SpeedLimit("blind_direction", text, mps, way)]
        mps = min(SONAR_STALE_MPS, mps)
        names = ", ".join(sonar.name for sonar in silent)
        text = words.at_most(mps, say("sonar silent ({names})", names=names), in_words)
        return [SpeedLimit("sonar_stale", text, mps, way)]


def _limit(code: str, why: Sentence, mps: float) -> SpeedLimit:
    """Return a limit for every direction."""
    return SpeedLimit(code, words.at_most(mps, why), mps)


def late_share(age_s: float) -> float:
    """Return the allowed share of a twist by the age of the newest scan: 1 until 0.22 s, 0 from 0.28 s."""
    return min(max((LASER_HALT_S - age_s) / (LASER_HALT_S - LASER_LATE_S), 0.0), 1.0)
