"""The gate: keeps the newest data, and says what of an asked twist may be sent.

Not thread-safe: one thread observes and decides. Time is an argument: `arrival_s` and `now_s` are the bridge's
monotonic clock, `stamp_s` the robot's own, which only pairs scans with odometry.

A verdict's codes, in the order in which the rules are tried (the last one that takes something away is told):

    idle              nothing is asked
    invalid           the asked twist is not made of numbers: stop
    odometry_missing  no odometry has come yet: stop, then neutral
    odometry_stale    the newest odometry is older than 0.2 s: stop, then neutral
    odometry_anew     the odometry began anew, and with it all that was seen: stop, then neutral
    scan_missing      a laser has sent nothing yet: stop, then neutral
    scan_stale        a laser's newest scan is older than 0.5 s: stop, then neutral
    scan_unpaired     a scan's stamp does not match the odometry's: stop, then neutral
    robot_limit       more is asked than the robot can do
    depth_missing     held to the blind speed: no picture of the depth camera has come yet, or it is not used
    depth_stale       held to the blind speed: the depth camera's newest picture is older than 0.5 s
    head_away         held to the blind speed: the depth camera looks elsewhere; or to the speed from which the robot
                      stops within what of a bent way is in its picture
    blind_direction   held to the blind speed: no sensor looks in the direction of travel; or to 0.1 m/s: only sonars do
    sonar_stale       held to 0.1 m/s: the sonars that look in the direction of travel are silent
    arm_away          held to 0.2 m/s: the arm is not at home, and where it reaches is not known
    robot_late        held back: the robot answers later than its profile assumes
    operator_late     held back: the way between robot and operator is longer than is good for this speed
    scan_late         a laser's newest scan is older than 0.22 s: slowed, down to nothing at 0.28 s
    obstacle          braking must end before contact; slowed or stopped
    near_miss         something is passed closely; slowed
    mover             something that moves would be met before the robot stands; slowed or stopped
    free              nothing is taken away
"""

from __future__ import annotations

import math

import numpy as np
from msgspec import structs

from robots.bridge.gate import words
from robots.bridge.gate.geometry import arc, arm_discs
from robots.bridge.gate.geometry.footprint import Discs, Footprint, footprint_of
from robots.bridge.gate.geometry.planar import Points, placed, put
from robots.bridge.gate.holds import Fault, Holds
from robots.bridge.gate.motion.certificate import plays_clear, restrains_nothing
from robots.bridge.gate.motion.corridors import Corridors
from robots.bridge.gate.motion.restraint import (
    OBSTACLE,
    Cause,
    Restraint,
    clamped,
    is_finite,
    is_still,
    restrain,
)
from robots.bridge.gate.motion.rollout import LONGEST_STEP_S, Commands, Sent, safe_share, stepped_up
from robots.bridge.gate.obstacles.depth_camera import DepthCamera, Frame
from robots.bridge.gate.obstacles.heading import Heading
from robots.bridge.gate.obstacles.laser_memory import LaserMemory
from robots.bridge.gate.obstacles.movers import MOVER, Movers
from robots.bridge.gate.obstacles.obstacle_cache import ObstacleCache
from robots.bridge.gate.obstacles.sonar_memory import SonarMemory
from robots.bridge.gate.obstacles.sources import Laser, Sonar, Source
from robots.bridge.gate.timing.freshness import LASER_STALE_S, ODOMETRY_STALE_S, Freshness
from robots.bridge.gate.timing.latency import Latency
from robots.bridge.gate.timing.trail import Trail
from robots.bridge.gate.values import (
    STILL,
    GateProfile,
    LaserScan,
    Obstacles,
    Pose,
    Sector,
    SensorHealth,
    SpeedLimit,
    Velocity,
    Verdict,
)

STANDSTILL_MPS = 0.01
STANDSTILL_RADPS = 0.02
BEYOND_REASON = 1e6  # metres, radians, or these a second; what is reckoned with more of them overflows
PERIOD_S = 0.05  # what is sent holds at most this long before the gate decides again


class Gate:
    """The safety gate of one robot."""

    def __init__(self, profile: GateProfile) -> None:
        """ValueError if the profile describes no footprint."""
        self.profile = profile
        self.footprint = self._base = footprint_of(profile)
        self.arm_discs: tuple[arm_discs.Disc, ...] = ()  # what of the arm reaches out of the base
        self._arm_ends: tuple[arm_discs.Disc, ...] = ()
        limits = profile.limits
        fastest = math.hypot(max(limits.forward_mps, limits.reverse_mps), limits.lateral_mps)
        self._trail = Trail(fastest, limits.turn_radps)
        self._odometry = Freshness()
        self._is_anew = False  # another run began, and the stick was not in the middle since
        self._velocity = STILL
        self._commands = Commands()
        self.latency = Latency(limits, profile.parameters.latency_s)
        self._reckoned = profile
        self._decided_s = -math.inf  # when the last twist was decided, and then sent
        self._lasers = {
            name: Laser(name, _word("laser", name, len(profile.scan_poses)), Pose(*pose), self.footprint)
            for name, pose in profile.scan_poses.items()
        }
        self._echoes = SonarMemory(self.footprint)
        self._sonars = {
            name: Sonar(number, name, Pose(*pose), profile.sonar_fov[name], self._echoes)
            for number, (name, pose) in enumerate(profile.sonar_poses.items())
        }
        self._memories = {name: LaserMemory(laser) for name, laser in self._lasers.items()}
        self._movers = {name: Movers() for name in self._lasers}
        self._heading = Heading(next(iter(self._lasers.values()))) if self._lasers else None
        self._depth = DepthCamera(profile.depth, self.footprint) if profile.depth else None
        self._holds = Holds(
            profile, self._odometry, self._trail, self._lasers.values(), self._sonars.values(), self._depth
        )
        depth, depth_memory = ((self._depth,), (self._depth.remembered,)) if self._depth else ((), ())
        self._sensors: tuple[Source, ...] = (*self._lasers.values(), *self._sonars.values(), *depth)
        self._sources = (*self._sensors, *self._memories.values(), self._echoes, *depth_memory)
        self._cache = ObstacleCache(self._sources, self._trail)

    # --- what comes in ------------------------------------------------------------------------

    def observe_odometry(self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity) -> bool:
        """Take odometry; whether it was new. Numbers that are none, or beyond reason, are as if nothing had come."""
        if not all(map(math.isfinite, (stamp_s, arrival_s))):
            return False
        if not all(abs(number) < BEYOND_REASON for number in (*pose, *velocity)):
            return False
        silent_s = self._odometry.age_s(arrival_s) or 0.0
        if not self._odometry.advances(stamp_s, arrival_s):
            return False
        if not self._trail.goes_on(stamp_s, pose, silent_s):
            self.forget(anew=True)
        self._trail.add(stamp_s, pose, velocity)
        self._velocity = velocity
        self.latency.arrived("odometry", stamp_s, arrival_s)
        self.latency.moved(velocity, arrival_s)
        return True

    def forget(self, anew: bool = False) -> None:
        """Drop all memory; keep only what the sensors show now.

        `anew`: the robot or its odometry began anew. Nothing tells then where anything was, the arm too, and how late
        the robot answers; the stick must return to the middle.
        """
        for parts in (self._memories, self._movers):
            for part in parts.values():
                part.forget()
        self._echoes.forget()
        if self._depth:
            self._depth.forget()
        if anew:
            self._is_anew = True
            self._trail.forget()
            self._holds.forget_posture()
            self.latency.forget()

    def observe_scan(self, scan: LaserScan) -> None:
        """Take a laser scan. Malformed or of an unknown source: as if nothing had come."""
        laser = self._lasers.get(scan.source)
        if laser and laser.observe(scan):
            self.latency.arrived(scan.source, scan.stamp_s, scan.arrival_s)
            if self._heading and self._heading.laser is laser:
                self._heading.correct(self._trail)
            self._memories[scan.source].learn(self._trail, scan.arrival_s)
            base = self._trail.pose_at(scan.stamp_s)
            if not self.profile.has_depth and laser.sweep is not None and base is not None:
                self._echoes.scan(laser.sweep, laser.pose, base, scan.arrival_s)
            self._look_for_movers(laser)

    def observe_range(
        self, source: str, stamp_s: float, arrival_s: float, range_m: float, max_range_m: float = math.inf
    ) -> None:
        """Take a sonar's range; at or above `max_range_m` is free. Malformed or unknown: as if nothing had come."""
        if sonar := self._sonars.get(source):
            sonar.observe(stamp_s, arrival_s, range_m, max_range_m, self._trail)

    def observe_depth(self, frame: Frame, stamp_s: float, arrival_s: float) -> None:
        """Take a depth camera's picture."""
        if self._depth:
            before_s = self._depth.freshness.stamp_s
            self._depth.arm_reach = self._holds.arm_reach(arrival_s)
            self._depth.observe(frame, stamp_s, arrival_s, self._trail)
            taken_s = self._depth.freshness.stamp_s
            base = None if taken_s is None or taken_s == before_s else self._trail.pose_at(taken_s)
            if base is not None:
                self._echoes.look(frame, base, arrival_s)

    def observe_bad_depth(self, why: str) -> None:
        """A depth camera's picture came that cannot be used."""
        if self._depth:
            self._depth.complain(why)

    def _look_for_movers(self, laser: Laser) -> None:
        stamp_s = laser.freshness.stamp_s
        base = None if stamp_s is None else self._trail.pose_at(stamp_s)
        sweep = laser.sweep
        if stamp_s is not None and base is not None and sweep is not None:
            sensor = put(laser.pose, base)
            self._movers[laser.name].observe(
                lambda: placed(laser.measured(sweep), base), sweep, sensor, stamp_s, self._trail.resets
            )
            if self._depth:
                self._depth.observe_scan(sweep, sensor, list(self._lasers).index(laser.name))

    def observe_posture(self, arm: arm_discs.Posture, arrival_s: float) -> None:
        """Take the arm's posture. Parts that reach out of the base become part of the footprint."""
        self._holds.observe_posture(arm, arrival_s)
        radius_m = self._base.reach(0.0)
        discs, ends = arm_discs.beyond(arm.discs or (), radius_m), arm_discs.beyond(arm.ends, radius_m)
        if (discs, ends) != (self.arm_discs, self._arm_ends):
            self.arm_discs, self._arm_ends = discs, ends
            self.footprint = self._with_base(discs)
            if self._depth:
                self._depth.body = self._with_base((*discs, *ends))

    def _with_base(self, discs: tuple[arm_discs.Disc, ...]) -> Footprint:
        return Discs(((0.0, 0.0, self._base.reach(0.0)), *discs)) if discs else self._base

    def observe_acknowledgement(self, took_s: float, now_s: float) -> None:
        """Take how long the robot's machine took to acknowledge a twist, there and back."""
        if math.isfinite(took_s):
            self.latency.acknowledged(took_s, now_s)

    def observe_operator(self, delay_s: float | None) -> None:
        """Take how long the way to the operator's page and back is; None if nobody knows."""
        self._holds.operator_delay_s = delay_s

    # --- what is known ------------------------------------------------------------------------

    def obstacles(self, now_s: float) -> Obstacles:
        """All points, base frame of the newest odometry. Computed again only when something came or went."""
        return self._cache.obstacles(now_s)

    def prepare(self, now_s: float) -> None:
        """Reckon now what a command would have to wait for: points at the newest pose, and what of them moves."""
        self._cache.newest(now_s)
        self._moves()

    def limits(self, now_s: float) -> tuple[SpeedLimit, ...]:
        """The limits that hold whatever is asked, for who shows or records them: no command waits for it."""
        return self._holds.standing(self._holds.everywhere(self.latency.in_force_s(now_s), now_s), now_s)

    def fault(self, now_s: float) -> Fault | None:
        """Why nothing that is asked for moves the robot, and nothing goes on by itself afterwards: data is missing."""
        fault = self._holds.fault(now_s)
        if self._is_anew and (fault is None or fault.sensor != "odometry"):  # why no scan is paired yet
            return Fault("odometry_anew", "the robot’s odometry began anew", "odometry")
        return fault

    def unseen(self, now_s: float) -> list[Sector]:
        """Where round the base neither laser nor sonar looks."""
        return self._holds.unseen(now_s)

    def standstill(self, now_s: float) -> bool | None:
        """Whether odometry says that the robot stands; None while it is too old to tell."""
        if not self._odometry.within(ODOMETRY_STALE_S, now_s):
            return None
        return arc.speed(self._velocity) < STANDSTILL_MPS and abs(self._velocity.w) < STANDSTILL_RADPS

    def sonar_range(self, source: str, now_s: float) -> float | None:
        """The newest range of a sonar in metres; None if nothing is in range, or nothing new came."""
        sonar = self._sonars.get(source)
        return None if sonar is None else sonar.range_m(now_s)

    def sensor_health(self, now_s: float) -> list[SensorHealth]:
        """How each sensor is, odometry first."""
        return [
            self._odometry_health(now_s),
            *(sensor.health(self._trail, now_s) for sensor in self._sensors),
        ]

    def _odometry_health(self, now_s: float) -> SensorHealth:
        text = self._odometry.silence(ODOMETRY_STALE_S, now_s)
        return SensorHealth("odometry", "odometry", not text, self._odometry.age_s(now_s), text)

    def _with_latency_of(self, latency_s: float) -> GateProfile:
        """The profile with the robot's latency as it is now in the place of the assumed one."""
        latency_s = round(latency_s, 2)
        if latency_s != self._reckoned.parameters.latency_s:
            parameters = structs.replace(self.profile.parameters, latency_s=latency_s)
            self._reckoned = structs.replace(self.profile, parameters=parameters)
        return self._reckoned

    # --- what may be done ---------------------------------------------------------------------

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Verdict:
        """Decide how much of `asked` may be published now; `sent` is the last published twist."""
        sent = sent if is_finite(sent) else STILL
        self.latency.sent(sent, self._decided_s)
        self._commands.add(sent, now_s)
        verdict = self._decided(asked, sent, now_s)
        self._commands.add(verdict.velocity, now_s)
        self._decided_s = now_s
        return verdict

    def _decided(self, asked: Velocity, sent: Velocity, now_s: float) -> Verdict:
        latency_s = self.latency.in_force_s(now_s)
        everywhere = self._holds.everywhere(latency_s, now_s)
        if not is_finite(asked):
            return Verdict(STILL, STILL, "invalid", "stopped: the command is not a number")
        possible = clamped(asked, self.profile)
        if is_still(possible):
            self._is_anew = False
            return Verdict(STILL, asked, "idle", "")
        if fault := self.fault(now_s):
            return Verdict(STILL, asked, fault.code, f"stopped: {fault.text}", fault.sensor, neutral=True)
        held = self._holds.held(asked, possible, everywhere, self.footprint, now_s)
        wanted = held.velocity
        if is_still(wanted):
            return Verdict(STILL, asked, held.code, held.text, way=held.way)
        turn_rates = (self._velocity.w, sent.w)
        profile = self._with_latency_of(self.latency.worst_s(now_s) + self.profile.parameters.latency_spare_s)
        obstacles, corridors = self._cache.newest(now_s)
        hulls = self._hulls(obstacles)
        allowed, cause = wanted, None
        if not restrains_nothing(wanted, turn_rates, corridors, self.footprint, profile):
            for hull, near in hulls:
                if is_still(allowed):
                    break
                found = restrain(allowed, turn_rates, near.points, near.source, hull, profile)
                if found.velocity != allowed:
                    allowed, cause = found.velocity, found.cause
        step_s = min(now_s - self._decided_s, LONGEST_STEP_S)
        risen = stepped_up(sent, allowed, profile, step_s)
        queue = self._commands.lately(now_s, profile.parameters.latency_s)
        if not self._plays_clear(risen, queue, corridors, profile):
            for hull, near in hulls:
                rolled = self._rolled_out(risen, queue, hull, near, profile)
                if rolled.cause is not None:
                    allowed, risen, cause = rolled.velocity, rolled.velocity, rolled.cause
        if cause is None:
            return Verdict(risen, asked, held.code, held.text, way=held.way)
        return self._restrained(asked, wanted, allowed, cause)._replace(velocity=risen)

    def _plays_clear(
        self, candidate: Velocity, queue: list[Sent], corridors: Corridors, profile: GateProfile
    ) -> bool:
        """Whether it is certain that a roll-out takes nothing away: nothing moves, and all is far off."""
        if self._moves():
            return False
        return plays_clear(candidate, queue, self._velocity, corridors, self.footprint, profile, PERIOD_S)

    def _hulls(self, obstacles: Obstacles) -> list[tuple[Footprint, Obstacles]]:
        """Which hull must stay clear of which obstacles.

        What is seen well within an arm is below or above it, or the arm would have touched it: it counts for the base
        alone. Else a robot whose arm is over a box or a table could not even retreat.
        """
        if not self.arm_discs:
            return [(self.footprint, obstacles)]
        under = Discs(self.arm_discs).gaps(obstacles.points) < -arm_discs.UNDER_M
        return [
            (hull, obstacles._replace(points=obstacles.points.T[:, rows].T, source=obstacles.source[rows]))
            for hull, rows in ((self.footprint, ~under), (self._base, under))
        ]

    def _rolled_out(
        self,
        candidate: Velocity,
        queue: list[Sent],
        hull: Footprint,
        obstacles: Obstacles,
        profile: GateProfile,
    ) -> Restraint:
        """The share of a candidate that stays clear when it is played out, and what is in the way of more."""
        if is_still(candidate):
            return Restraint(candidate)
        drift = self._drift(obstacles.points)
        # Moving obstacles went on since the scan.
        points = obstacles.points if drift is None else obstacles.points + self._scan_age_s() * drift
        rolled = safe_share(
            candidate,
            queue,
            self._velocity,
            points,
            drift,
            hull,
            profile,
            PERIOD_S,
            profile.parameters.latency_s,
        )
        if rolled.share == 1.0:
            return Restraint(candidate)
        at = obstacles.points[rolled.row]
        gap_m = float(hull.gaps(at[None])[0])
        rule = OBSTACLE if drift is None or not drift[rolled.row].any() else MOVER
        cause = Cause(rule, (float(at[0]), float(at[1])), gap_m, int(obstacles.source[rolled.row]))
        return Restraint(candidate.scaled(rolled.share), cause)

    def _moves(self) -> bool:
        """Whether anything that a laser sees moves by itself."""
        return any(movers.any for movers in self._movers.values())

    def _scan_age_s(self) -> float:
        """How much older the oldest of the newest scans is than the newest odometry, with which a roll-out begins."""
        stamps = [laser.freshness.stamp_s for laser in self._lasers.values()]
        newest = self._odometry.stamp_s
        known = [stamp_s for stamp_s in stamps if stamp_s is not None]
        return min(max(newest - min(known), 0.0), LASER_STALE_S) if known and newest is not None else 0.0

    def _drift(self, points: Points) -> Points | None:
        """How points of the base frame move by themselves, m/s; None if nothing moves."""
        newest = self._trail.newest
        moving = [movers for movers in self._movers.values() if movers.any]
        if newest is None or not moving:
            return None
        there = placed(points, newest)
        drift = np.zeros_like(there)
        for movers in moving:
            drift = np.where(drift.any(axis=1, keepdims=True), drift, movers.drift(there))
        return placed(drift, Pose(0.0, 0.0, -newest.yaw))

    def _restrained(self, asked: Velocity, wanted: Velocity, allowed: Velocity, cause: Cause) -> Verdict:
        """The verdict about a twist that an obstacle holds back."""
        source = self._sources[cause.source]
        bearing = math.atan2(cause.point[1], cause.point[0])
        reason = words.obstacle(source.word, cause.gap_m, bearing, cause.rule)
        return Verdict(
            allowed,
            asked,
            cause.rule,
            f"{words.what_is_left(asked, allowed)}: {reason}",
            source.name,
            cause.gap_m,
            bearing,
            words.side(bearing),
            cause.point,
        )


def _word(kind: str, name: str, how_many: int) -> str:
    """A sensor's name for people: its kind, and its own name where there are several."""
    return kind if how_many == 1 else f"{kind} {name}"
