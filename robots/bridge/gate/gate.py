"""The gate: keeps the newest data and decides how much of an asked twist may be sent.

Not thread-safe: one thread observes and decides. Time is an argument: `arrival_s` and `now_s` are the bridge's
monotonic clock, `stamp_s` the robot's own, which only pairs scans with odometry.

A verdict's codes, in the order of the rules (the verdict names the last rule that reduces the twist):

    idle              no motion is asked
    invalid           the asked twist is not finite: stop
    odometry_anew     the odometry restarted or jumped, so memory is empty: stop, then neutral
    odometry_missing  no odometry has come yet: stop, then neutral
    odometry_stale    the newest odometry is older than 0.2 s: stop, then neutral
    scan_missing      a laser has sent nothing yet: stop, then neutral
    scan_stale        a laser's newest scan is older than 0.5 s: stop, then neutral
    scan_unpaired     a scan's stamp does not match the odometry's: stop, then neutral
    robot_limit       the asked twist exceeds the robot's limits
    depth_missing     limited to the blind speed: no depth picture yet, or the camera is not used
    depth_stale       limited to the blind speed: the newest depth picture is older than 0.5 s
    head_away         limited to the blind speed: the depth camera looks elsewhere; or to the speed from which the robot
                      stops within the visible part of a way that bends
    blind_direction   limited to the blind speed: no sensor watches the direction of travel; or to 0.1 m/s:
                      only sonars do
    sonar_stale       at most 0.1 m/s: the sonars in the direction of travel are silent
    arm_away          at most 0.2 m/s: the arm is not at home, and its posture is unknown; or a limb may still
                      move, and its joint states have ended
    robot_late        limited: the robot answers later than its profile assumes
    operator_late     limited: the delay between robot and operator is too long for this speed
    camera_late       limited: the camera picture by which the operator drives is too old for this speed
    scan_late         a laser's newest scan is older than 0.22 s: slowed, down to nothing at 0.28 s
    obstacle          braking must end before contact; slowed or stopped
    near_miss         the robot passes an obstacle closely; slowed
    mover             the robot could meet a moving obstacle before it stands; slowed or stopped
    behind_unseen     reverse to where neither the depth camera has looked nor the robot has been: stop, then neutral;
                      asked again, reverse says that a person has looked
    free              the twist is unchanged
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from robots.bridge.gate import words
from robots.bridge.gate.arm import discs as arm_discs
from robots.bridge.gate.motion.braking import deceleration
from robots.bridge.gate.motion.certificate import plays_clear, restrains_nothing
from robots.bridge.gate.motion.corridors import Corridors
from robots.bridge.gate.motion.rollout import LONGEST_STEP_S, Commands, Sent, safe_share, stepped_up
from robots.bridge.gate.motion.safe_twist import (
    OBSTACLE,
    Cause,
    Restraint,
    clamped,
    is_finite,
    is_still,
    restrain,
)
from robots.bridge.gate.movers.forecast import Forecast, forecast
from robots.bridge.gate.movers.movers import MOVER, Movers
from robots.bridge.gate.movers.tracks import Track
from robots.bridge.gate.obstacles.behind import Behind
from robots.bridge.gate.obstacles.depth_camera import DepthCamera, Frame
from robots.bridge.gate.obstacles.heading import Heading
from robots.bridge.gate.obstacles.laser_memory import LaserMemory
from robots.bridge.gate.obstacles.obstacle_cache import ObstacleCache
from robots.bridge.gate.obstacles.sonar_memory import SonarMemory
from robots.bridge.gate.obstacles.sources import Laser, Sonar, Source
from robots.bridge.gate.sensor_limits import Fault, SensorLimits
from robots.bridge.gate.timing.freshness import ODOMETRY_STALE_S, Freshness
from robots.bridge.gate.timing.latency import Latency
from robots.bridge.gate.timing.trail import LARGEST_HOLE_S, Trail
from robots.bridge.gate.timing.unseen_motion import Doubt, UnseenMotion
from robots.bridge.gate.values import ForgetCode, Forgotten, Kind, LaserScan, Obstacles, Sector, SensorHealth
from robots.shared.configuration.gate_profile import GateProfile
from robots.shared.geometry.arc import speed
from robots.shared.geometry.footprint import Discs, Footprint, footprint_of
from robots.shared.geometry.planar import NO_POINTS, ORIGIN, Drift, Points, placed, put, relative_to
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.verdict import SpeedLimit, Verdict
from robots.shared.sentences import joined, say

STANDSTILL_MPS = 0.01
STANDSTILL_RADPS = 0.02
REMEMBERED: tuple[Kind, ...] = ("memory", "depth memory")
BEYOND_REASON = 1e6  # limit for the odometry's numbers (m, rad, m/s, rad/s): larger ones would overflow
UNSEEN_BEHIND = say("no sensor has looked for table tops behind")
LOOK_BEHIND = say("Hold “Turn and look”; or look behind the robot yourself, then ask for reverse again")
PERIOD_S = 0.05  # longest time between two decisions
# From one decision to the next, the safe speed is expected to rise by at most this factor and this step. A
# wrong expectation costs time only.
RISES, RISES_MPS = 1.25, 0.05


class Gate:
    """The safety gate of one robot."""

    def __init__(self, profile: GateProfile) -> None:
        """Raise ValueError if the profile describes no footprint."""
        self.profile = profile
        self.footprint = self._base = footprint_of(profile)
        self.arm_discs: tuple[arm_discs.Disc, ...] = ()  # parts of the arm outside the base
        self._arm_ends: tuple[arm_discs.Disc, ...] = ()
        limits = profile.limits
        fastest = math.hypot(max(limits.forward_mps, limits.reverse_mps), limits.lateral_mps)
        self._trail = Trail(fastest, limits.turn_radps)
        self._odometry = Freshness()
        self._restarted = False  # the odometry restarted, and since then the stick was not in the middle
        self._velocity = STILL
        self._commands = Commands()
        self._unseen_motion = UnseenMotion(limits, deceleration(profile))
        self.forgotten: Forgotten | None = None  # the last time at which memory was dropped
        self.restarts = 0  # of the odometry: poses before the last one are in another frame
        self.latency = Latency(limits, profile.parameters.latency_s)
        self._profile_now = profile
        self._restrained_mps = math.inf  # speed to which obstacles limited the last decision
        self._guesses: tuple[int, ...] = ()  # rows of points that blocked turns in the last decision
        self._decided_s = -math.inf  # time of the last decision, and so of the last sent twist
        self._lasers = {
            name: Laser(name, _word(say("laser"), name, len(profile.scan_poses)), Pose(*pose), self.footprint)
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
        # A robot without a depth camera drives at its blind speed everywhere.
        self._behind = Behind(self._base.reach(0.0), deceleration(profile)[0]) if self._depth else None
        self._limits = SensorLimits(
            profile, self._odometry, self._trail, self._lasers.values(), self._sonars.values(), self._depth
        )
        depth, depth_memory = ((self._depth,), (self._depth.remembered,)) if self._depth else ((), ())
        self._sensors: tuple[Source, ...] = (*self._lasers.values(), *self._sonars.values(), *depth)
        self._sources = (*self._sensors, *self._memories.values(), self._echoes, *depth_memory)
        self._cache = ObstacleCache(self._sources, self._trail)

    # --- input ----------------------------------------------------------------------------------

    def observe_odometry(
        self, stamp_s: float, arrival_s: float, pose: Pose, velocity: Velocity, messages: int = 1
    ) -> bool:
        """Take odometry; return whether it was new. Numbers that are not finite or absurd are ignored.

        `messages`: of so many that came together it is the newest, and the others are not observed.
        """
        if not all(map(math.isfinite, (stamp_s, arrival_s))):
            return False
        if not all(abs(number) < BEYOND_REASON for number in (*pose, *velocity)):
            return False
        silent_s = self._odometry.age_s(arrival_s) or 0.0
        if not self._odometry.advances(stamp_s, arrival_s):
            return False
        missing_s = self._trail.missing_s(stamp_s, silent_s)
        if missing_s < 0.0 and self._trail.rewind(stamp_s):
            missing_s = silent_s
        self._follow(missing_s, pose, velocity, arrival_s)
        self._trail.add(stamp_s, pose, velocity)
        self._velocity = velocity
        stands = self._trail.rest.stands(STANDSTILL_MPS, STANDSTILL_RADPS)
        self._unseen_motion.moved(STILL if stands else velocity, arrival_s)
        self.latency.arrived("odometry", stamp_s, arrival_s, messages)
        self.latency.moved(velocity, arrival_s)
        if self._behind and self._trail.newest is not None:
            self._behind.moved(self._trail.newest, arrival_s)
        return True

    def observe_odometry_alike(self, stamp_s: float, arrival_s: float) -> None:
        """Take the times of a message that shows the same as the next one: it only tells how late messages come."""
        if math.isfinite(stamp_s):
            self.latency.arrived("odometry", stamp_s, arrival_s)

    def _follow(self, missing_s: float, pose: Pose, velocity: Velocity, arrival_s: float) -> None:
        """Check whether odometry continues the last one, after `missing_s` without any.

        After a gap the robot may be elsewhere than its odometry says. A motion that nothing explains makes the pose
        doubtful; if it is large, the odometry jumped.
        """
        gap = missing_s > LARGEST_HOLE_S
        doubt = self._unseen_motion.doubt(velocity, arrival_s, missing_s) if gap else None
        if broken := self._trail.break_before(pose, missing_s, doubt):
            self.forget(restarted=True, code=broken)
        elif doubt:
            shift, base = self._trail.shift(pose), self._trail.corrected(pose)
            self._doubt(Doubt(max(doubt.metres, shift.metres), max(doubt.radians, shift.radians)), base)

    def _doubt(self, doubt: Doubt, base: Pose) -> None:
        """Keep all memory of a robot that is at `base`, or as far away as `doubt` says."""
        for memory in self._memories.values():
            memory.doubt(doubt, base)
        self._echoes.doubt(doubt, base)
        if self._depth:
            self._depth.doubt(doubt, base)
        for movers in self._movers.values():
            movers.doubt(doubt)
        if self._behind:
            self._behind.doubt(doubt)

    def forget(self, restarted: bool = False, code: ForgetCode = "asked") -> None:
        """Drop all memory, because of `code`; keep only current sensor data.

        `restarted`: the robot or its odometry restarted. Then poses, the arm's posture and the latency are unknown,
        too, and the stick must return to the middle.
        """
        memories = (*self._memories.values(), self._echoes, *((self._depth,) if self._depth else ()))
        if not all(memory.is_empty for memory in memories):
            self.forgotten = Forgotten(self.forgotten.number + 1 if self.forgotten else 1, code)
        for parts in (self._memories, self._movers):
            for part in parts.values():
                part.forget()
        self._echoes.forget()
        if self._depth:
            self._depth.forget()
        if self._behind:
            self._behind.forget()
        if restarted:
            self._restarted = True
            self.restarts += 1
            self._trail.forget()
            self._limits.forget_posture()
            self.latency.forget()

    def observe_scan(self, scan: LaserScan, thins: bool = False) -> None:
        """Take a laser scan. A malformed scan, or one of an unknown source, is ignored.

        `thins`: nobody drives, and the robot stands, so memory may learn from every second scan.
        """
        laser = self._lasers.get(scan.source)
        if laser and laser.observe(scan):
            self.latency.arrived(scan.source, scan.stamp_s, scan.arrival_s)
            if self._heading and self._heading.laser is laser:
                self._heading.correct(self._trail)
            memory = self._memories[scan.source]
            if not thins or memory.is_due():
                memory.learn(self._trail, scan.arrival_s)
            base = self._trail.pose_at(scan.stamp_s)
            if not self.profile.has_depth and laser.sweep is not None and base is not None:
                self._echoes.scan(laser.sweep, laser.pose, base, scan.arrival_s)
            self._look_for_movers(laser)

    def observe_range(
        self, source: str, stamp_s: float, arrival_s: float, range_m: float, max_range_m: float = math.inf
    ) -> None:
        """Take a sonar's range. `max_range_m` or more means free. Malformed or unknown ranges are ignored."""
        if sonar := self._sonars.get(source):
            is_placed = self._odometry.within(LARGEST_HOLE_S, arrival_s)
            sonar.observe(stamp_s, arrival_s, range_m, max_range_m, self._trail, is_placed=is_placed)

    def observe_depth(self, frame: Frame, stamp_s: float, arrival_s: float) -> None:
        """Take a depth camera's picture."""
        if self._depth:
            before_s = self._depth.freshness.stamp_s
            self._depth.arm_reach = self._limits.arm_reach(arrival_s)
            self._depth.observe(frame, stamp_s, arrival_s, self._trail)
            taken_s = self._depth.freshness.stamp_s
            base = None if taken_s is None or taken_s == before_s else self._trail.pose_at(taken_s)
            if base is not None:
                self._echoes.look(frame, base, arrival_s)
                if self._behind:
                    self._behind.looked(self._depth, base, arrival_s)

    def observe_bad_depth(self, why: str) -> None:
        """Take the reason why a depth picture cannot be used."""
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
        """Take the arm's posture. Parts outside the base extend the footprint."""
        self._limits.observe_posture(arm, arrival_s)
        radius_m = self._base.reach(0.0)
        discs, ends = arm_discs.beyond(arm.discs or (), radius_m), arm_discs.beyond(arm.ends, radius_m)
        if (discs, ends) != (self.arm_discs, self._arm_ends):
            self.arm_discs, self._arm_ends = discs, ends
            self.footprint = self._with_base(discs)
            if self._depth:
                self._depth.own_outline = self._with_base((*discs, *ends))

    def _with_base(self, discs: tuple[arm_discs.Disc, ...]) -> Footprint:
        return Discs(((0.0, 0.0, self._base.reach(0.0)), *discs)) if discs else self._base

    def observe_lost_limb(self, limb: str | None) -> None:
        """Take the limb that may move without joint states, if any: the robot must drive slowly."""
        self._limits.lost_limb = limb

    def observe_acknowledgement(self, took_s: float, now_s: float) -> None:
        """Take the time (s) from a sent twist to its acknowledgement by the robot's computer."""
        if math.isfinite(took_s):
            self.latency.acknowledged(took_s, now_s)

    def observe_operator(self, delay_s: float | None) -> None:
        """Take the round-trip time to the operator's page; None if unknown."""
        self._limits.operator_delay_s = delay_s

    def observe_new_driver(self) -> None:
        """Take that somebody else drives from now on: this person has not looked behind the robot.

        What scans showed that were thinned out before is learned now.
        """
        for name, memory in self._memories.items():
            arrival_s = self._lasers[name].freshness.arrival_s
            if arrival_s is not None:
                memory.learn(self._trail, arrival_s)
        if self._behind:
            self._behind.forget_look()

    def observe_camera_view(self, age_s: float | None) -> None:
        """Take the age of the camera picture by which the operator drives; None: without a camera."""
        self._limits.camera_view_s = age_s

    # --- state ----------------------------------------------------------------------------------

    def obstacles(self, now_s: float) -> Obstacles:
        """Return all points, base frame of the newest odometry. They are computed again only after a change."""
        return self._cache.obstacles(now_s)

    def prepare(self, now_s: float) -> None:
        """Compute points at the newest pose and moving obstacles, so that no command waits for them."""
        self._cache.newest(now_s)
        self._moves()

    def limits(self, now_s: float) -> tuple[SpeedLimit, ...]:
        """Return the limits that are independent of the command, for display and records. No command waits for it."""
        everywhere = self._limits.everywhere(self.latency.in_force_s(now_s), self.latency.slow_clock, now_s)
        return (*self._limits.of_any_command(everywhere, now_s), *self._warning_of_reverse(now_s))

    def _warning_of_reverse(self, now_s: float) -> tuple[SpeedLimit, ...]:
        """Return the limit that says before a pull that it will be refused."""
        base = self._trail.newest
        if self._behind is None or base is None or not self._behind.warns(base, now_s):
            return ()
        return (
            SpeedLimit(
                "behind_unseen", say("reverse needs a look: {why}", why=UNSEEN_BEHIND), 0.0, "reverse"
            ),
        )

    def fault(self, now_s: float) -> Fault | None:
        """Return the missing data that forbids motion; afterwards the stick must return to the middle."""
        if self._restarted:  # checked first: this is known only until the stick is in the middle
            return Fault("odometry_anew", "the robot’s odometry restarted", "odometry")
        return self._limits.fault(now_s)

    def hears_all(self, now_s: float) -> bool:
        """Return whether odometry and all lasers come on time."""
        return self.fault(now_s) is None and not self._limits.late_lasers(now_s)

    def depth_heights(self, points: Points) -> tuple[NDArray[np.float32], NDArray[np.float32]] | None:
        """Return the lowest and the highest height (m) that the depth camera saw at each of its obstacles.

        `points`: these obstacles (base frame). None: there is no camera, or no pose.
        """
        base = self._trail.newest
        if self._depth is None or base is None:
            return None
        return self._depth.heights(placed(points, base))

    def unseen(self, now_s: float) -> list[Sector]:
        """Return the sectors around the base without laser and sonar."""
        return self._limits.unseen(now_s)

    def look_to(self, now_s: float) -> float | None:
        """Return the direction of the nearest remembered depth point, for the head (radians, left positive).

        None if no such point is near and ahead, or if a picture straight ahead shows it near the middle.
        """
        if self._depth is None:
            return None
        obstacles = self.obstacles(now_s)
        remembered = obstacles.points[obstacles.source == self._sources.index(self._depth.remembered)]
        return self._depth.turn_to(remembered)

    def odometry_is_stale(self, now_s: float) -> bool:
        """Return whether the newest odometry is too old to drive by."""
        return not self._odometry.within(ODOMETRY_STALE_S, now_s)

    def standstill(self, now_s: float) -> bool | None:
        """Return whether the robot stands, according to its odometry; None while the odometry is stale."""
        if self.odometry_is_stale(now_s):
            return None
        return self._trail.rest.stands(STANDSTILL_MPS, STANDSTILL_RADPS)

    def sonar_range(self, source: str, now_s: float) -> float | None:
        """Return the newest range of a sonar in metres; None if nothing is in range or the sonar is silent."""
        sonar = self._sonars.get(source)
        return None if sonar is None else sonar.range_m(now_s)

    def sensor_health(self, now_s: float) -> list[SensorHealth]:
        """Return the state of each sensor, odometry first."""
        return [
            self._odometry_health(now_s),
            *(sensor.health(self._trail, now_s) for sensor in self._sensors),
        ]

    def _odometry_health(self, now_s: float) -> SensorHealth:
        text = self._odometry.silence(ODOMETRY_STALE_S, now_s)
        return SensorHealth("odometry", "odometry", not text, self._odometry.age_s(now_s), text)

    def _with_latency_of(self, latency_s: float) -> GateProfile:
        """Return the profile with the current latency instead of the assumed one."""
        latency_s = round(latency_s, 2)
        if latency_s != self._profile_now.parameters.latency_s:
            parameters = structs.replace(self.profile.parameters, latency_s=latency_s)
            self._profile_now = structs.replace(self.profile, parameters=parameters)
        return self._profile_now

    # --- a robot that drives itself -------------------------------------------------------------

    @property
    def velocity(self) -> Velocity:
        """The measured velocity."""
        return self._velocity

    def depth_age_s(self, now_s: float) -> float | None:
        """Return the age of the newest depth picture in seconds; None: there is none."""
        return self._depth.freshness.age_s(now_s) if self._depth else None

    def looks_ahead(self, now_s: float) -> bool:
        """Return whether the depth camera shows the way (at standstill: ahead); True without a camera."""
        return self._limits.looks_ahead(self._velocity, now_s)

    def unwatched(self, now_s: float) -> SpeedLimit | None:
        """Return the exceeded limit if the robot is too fast for a way that no sensor watches; else None."""
        return self._limits.unwatched(self._velocity, now_s)

    def laser_looks(self, direction: float) -> bool:
        """Return whether a laser's newest scan watches a direction of the base frame."""
        return any(laser.covers(direction) for laser in self._lasers.values())

    def obstacles_as_seen(self, now_s: float) -> Obstacles:
        """Return all points at their measured places: without unseen near sides and odometry error."""
        return self._cache.as_seen(now_s)

    def unseen_near_sides(self) -> Points:
        """Return places (base frame) that may be near sides which the depth camera could not measure."""
        return self._depth.near_sides(self._trail) if self._depth else NO_POINTS

    def must_brake(
        self, velocities: Sequence[Velocity], obstacles: Obstacles, latency_s: float
    ) -> Verdict | None:
        """Return why a robot that keeps one of these velocities must brake now; None: it need not brake.

        It must brake if later zeros, which take effect after `latency_s`, could not stop it clear of the
        obstacles. The result is also None if even braking now ends too near, and driving on ends no nearer
        (docs/gate.md, 6). So call this before it is too late.
        """
        profile = self._with_latency_of(latency_s)
        for hull, near in self._hulls(obstacles):
            for velocity in velocities:
                rolled = self._rolled_out(velocity, [Sent(velocity, math.inf)], hull, near, profile)
                if rolled.cause is not None:
                    return self._restrained(velocity, velocity, STILL, rolled.cause)
        return None

    # --- decision -------------------------------------------------------------------------------

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Verdict:
        """Decide how much of `asked` may be published now; `sent` is the last published twist."""
        sent = sent if is_finite(sent) else STILL
        self.latency.sent(sent, self._decided_s)
        self._commands.add(sent, now_s)
        self._unseen_motion.sent(sent, now_s)
        verdict = self._seen_behind(self._decided(asked, sent, now_s), now_s)
        self._commands.add(verdict.velocity, now_s)
        self._unseen_motion.sent(verdict.velocity, now_s)
        self._decided_s = now_s
        return verdict

    def _decided(self, asked: Velocity, sent: Velocity, now_s: float) -> Verdict:
        latency_s = self.latency.in_force_s(now_s)
        everywhere = self._limits.everywhere(latency_s, self.latency.slow_clock, now_s)
        if not is_finite(asked):
            return Verdict(STILL, STILL, "invalid", say("stopped: the command is not a number"))
        possible = clamped(asked, self.profile)
        if is_still(possible):
            self._restarted = False
            return Verdict(STILL, asked, "idle", "")
        if fault := self.fault(now_s):
            text = say("stopped: {why}", why=fault.text)
            return Verdict(STILL, asked, fault.code, text, fault.sensor, neutral=True)
        held = self._limits.limited(asked, possible, everywhere, self.footprint, now_s)
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
                expected = self._expected_share(allowed)
                found = restrain(
                    allowed, turn_rates, near.points, near.source, hull, profile, expected, self._guesses
                )
                self._guesses = found.guesses or self._guesses
                if found.velocity != allowed:
                    allowed, cause = found.velocity, found.cause
        self._restrained_mps = math.inf if cause is None else speed(allowed)
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

    def _seen_behind(self, verdict: Verdict, now_s: float) -> Verdict:
        """Refuse an allowed reverse to where nothing has looked for table tops."""
        base = self._trail.newest
        if self._behind is None or base is None:
            return verdict
        if verdict.code == "idle":
            self._behind.rests()
        if not self._behind.forbids(verdict.velocity, base, now_s):
            return verdict
        text = say("stopped: {why}. {advice}", why=UNSEEN_BEHIND, advice=LOOK_BEHIND)
        return Verdict(STILL, verdict.asked, "behind_unseen", text, neutral=True, way="reverse")

    def _expected_share(self, wanted: Velocity) -> float:
        """Estimate from the last decision the largest share of a twist that obstacles will leave."""
        wanted_mps, most_mps = speed(wanted), RISES * self._restrained_mps + RISES_MPS
        return min(most_mps / wanted_mps, 1.0) if wanted_mps > 0.0 else 1.0

    def _plays_clear(
        self, candidate: Velocity, queue: list[Sent], corridors: Corridors, profile: GateProfile
    ) -> bool:
        """Return whether a roll-out surely changes nothing: all obstacles stand, and are far enough away."""
        if self._moves():
            return False
        return plays_clear(candidate, queue, self._velocity, corridors, self.footprint, profile, PERIOD_S)

    def _hulls(self, obstacles: Obstacles) -> list[tuple[Footprint, Obstacles]]:
        """Return each hull with the obstacles that it must avoid.

        A point deep inside the arm's discs is below or above the arm: otherwise the arm would have touched
        it. It counts for the base only, or a robot with its arm over a table could not even retreat.
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
        """Return the share of a candidate that stays clear in the roll-out, and the obstacle that limits it."""
        if is_still(candidate):
            return Restraint(candidate)
        points, drift = obstacles.points, None
        moving = self._moving()
        if coming := self._forecast([track for _, track in moving]):
            standing = np.zeros(len(points))
            velocity, radius, grows = coming.drift
            drift = Drift(
                np.concatenate((np.zeros_like(points), velocity)),
                np.concatenate((standing, radius)),
                np.concatenate((standing, grows)),
            )
            points = np.concatenate((points, coming.points))
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
        at, disc = points[rolled.row], rolled.row - len(obstacles.points)
        point, gap_m = (float(at[0]), float(at[1])), float(hull.gaps(at[None])[0])
        if coming is None or disc < 0:
            cause = Cause(OBSTACLE, point, gap_m, int(obstacles.source[rolled.row]))
        else:
            laser, track = moving[int(coming.tracks[disc])]
            cause = Cause(MOVER, point, gap_m - float(coming.drift.radius[disc]), laser, track.mps)
        return Restraint(candidate.scaled(rolled.share), cause)

    def _moves(self) -> bool:
        """Return whether a laser sees a moving obstacle."""
        return any(movers.tracks for movers in self._movers.values())

    def _moving(self) -> list[tuple[int, Track]]:
        """Return what moves, each with the number of its laser among the sources."""
        return [
            (number, track) for number, movers in enumerate(self._movers.values()) for track in movers.tracks
        ]

    def _forecast(self, tracks: list[Track]) -> Forecast | None:
        """Return where movers may be from the newest odometry on (base frame); None if nothing moves."""
        newest, stamp_s = self._trail.newest, self._odometry.stamp_s
        if newest is None or stamp_s is None or not tracks:
            return None
        points, drift, numbers = forecast(tracks, stamp_s)
        turned = drift._replace(velocity=placed(drift.velocity, Pose(0.0, 0.0, -newest.yaw)))
        return Forecast(placed(points, relative_to(ORIGIN, newest)), turned, numbers)

    def _restrained(self, asked: Velocity, wanted: Velocity, allowed: Velocity, cause: Cause) -> Verdict:
        """Return the verdict for a twist that an obstacle limits."""
        source = self._sources[cause.source]
        bearing = math.atan2(cause.point[1], cause.point[0])
        reason = words.obstacle(source.word, cause.gap_m, bearing, cause.rule, cause.mps)
        if isinstance(source, Sonar) and source.own_echo:
            reason = joined("; ", [reason, source.own_echo])
        if source.kind in REMEMBERED and speed(allowed) == 0.0 and speed(wanted) > 0.0:
            reason = joined("; ", [reason, words.NOT_SEEN_NOW])
        return Verdict(
            allowed,
            asked,
            cause.rule,
            joined(": ", [words.reduction(asked, allowed), reason]),
            source.name,
            cause.gap_m,
            bearing,
            words.side(bearing),
            cause.point,
        )


def _word(kind: str, name: str, how_many: int) -> str:
    """Return a sensor's name for people: its kind, and its own name if there are several."""
    return kind if how_many == 1 else joined(" ", [kind, name])
