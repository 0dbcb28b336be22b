"""The closed loop: simulated robot, delayed sensors, a driver, a controller, delayed commands. Faster than real time.

The loop does not use the controllers' calculations. The clocks of console and robot differ, messages are
delayed, and published twists pass the robot's own mux and base controller with their time-outs.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from msgspec import structs

from benchmarks.world.arm import ArmShow, MovingArm
from benchmarks.world.controllers import Controller, Fan, GateController, Ranges
from benchmarks.world.robot import tiago_head
from benchmarks.world.sensors import STANDARD, Sensors
from benchmarks.world.witness import DEPTH, LASER, Look
from robots.bridge.drive.drive_input import velocity_of
from robots.bridge.gate.sensing.depth import Transform
from robots.bridge.head.head import AHEAD_TAKES_S, FOLLOW_RADPS, Aim, Head
from robots.bridge.robot.sensors.frames import TURNING_RADPS
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry import poses
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.records.verdict import SpeedLimit
from robots.shared.wire import Drive
from robots.simulator.faults import Faults
from robots.simulator.joints.frames import camera_pose
from robots.simulator.physics.base import Twist, clamp
from robots.simulator.physics.mujoco_world import Pose, WorldReader
from robots.simulator.physics.mux import TwistMux
from robots.simulator.robot import TICK_S, Robot
from robots.simulator.sensors.depth import DepthCamera
from robots.simulator.sensors.odometry import Drift
from robots.simulator.worlds import World

STARTS_S = 1000.0  # the console's clock when a run begins
ROBOT_CLOCK_S = 1.7e9  # the robot's clock is ahead by this
WARM_UP_S = 0.4  # before the stick is touched
PERIOD_S = 0.05  # of decisions
SONAR_HZ = 5.0
PHASES = 10  # each sensor begins with a random offset of less than this number of ticks
GAP_EVERY = 4  # decisions between two measurements of the gap, which take longer than a decision
SLOWS = 0.2  # growth of the link's delay, seconds per second
GHOST_SHARE = 0.0005  # of beams that measure a single object that is not there
LOOKS_DOWN = -0.68  # tilt of the head, radians, as after *Look ahead*: towards the floor ahead of the robot
INPUT = "key_vel"


class Jump(NamedTuple):
    """From `at_s` on (seconds since the start), sensors or commands suddenly come later by `by_s`."""

    at_s: float
    by_s: float
    sensors: bool
    commands: bool


class Delays(NamedTuple):
    """Delays of messages in seconds. Each message takes up to `jitter_s` longer."""

    odometry_s: float
    scan_s: float
    depth_s: float
    command_s: float
    jitter_s: float = 0.01

    @classmethod
    def drawn(cls, random: np.random.Generator) -> Delays:
        """Draw delays as in a good local network, where TIAGo's wheels obey within 0.1 s."""
        drawn = random.uniform((0.005, 0.02, 0.06, 0.02), (0.02, 0.06, 0.12, 0.08))
        odometry, scan, depth, command = drawn.tolist()
        return cls(odometry, scan, depth, command)


@dataclass(frozen=True)
class Conditions:
    """Faults of sensors, robot and network."""

    blanked: bool = False  # PAL's /scan: nothing within +-0.30 m of the base
    faults: tuple[tuple[float, Faults], ...] = ()  # from this second on
    late_s: float = 0.0  # commands come this much later
    slows_to_s: float = 0.0  # delays of messages and commands grow up to this
    jump: Jump | None = None
    # When no message passes in either direction, and for how long (s). The messages come at the end.
    hiccups: tuple[tuple[float, float], ...] = ()
    clock_s: float = 0.0  # the robot's clock is this far off
    # Fixed direction of the head; None: it follows the turns of the drive.
    head_pan: float | None = None
    sensors: Sensors = STANDARD
    drift: Drift = field(default_factory=Drift)


class Seen(NamedTuple):
    """Knowledge of a driver: seconds since the start, and the robot's true pose."""

    time_s: float
    pose: Pose


class Stick(NamedTuple):
    """Stick position. Only moments with `trying` are judged."""

    x: float
    w: float
    share: float = 1.0
    trying: bool = True


RELEASED = Stick(0.0, 0.0, trying=False)


class Driver(Protocol):
    """A driver: holds the stick."""

    def hold(self, seen: Seen) -> Stick | None:
        """Return the stick position now; None: the drive is done."""


class Moment(NamedTuple):
    """One decision."""

    time_s: float
    pose: Pose
    moving: Twist
    asked: Velocity
    sent: Velocity
    code: str
    text: str
    gap_m: float  # measured at most `GAP_EVERY` decisions ago
    trying: bool
    limits: tuple[SpeedLimit, ...] = ()  # that do not depend on obstacles


class Touch(NamedTuple):
    """The first moment of a contact. `robot`: the robot's speed before it."""

    time_s: float
    part: str
    other: str
    robot: Twist
    at: tuple[float, float]  # in the world


@dataclass
class Trace:
    """Events of a run."""

    moments: list[Moment] = field(default_factory=list)
    touches: list[Touch] = field(default_factory=list)
    way_m: float = 0.0
    reverse_m: float = 0.0  # of the way
    arrived: bool = False
    time_s: float = 0.0


class Leaving(NamedTuple):
    """A person, a chair or a table goes away: from this second on, by this much, at this speed."""

    name: str
    since_s: float
    at: tuple[float, float]
    way: tuple[float, float]
    mps: float

    def place(self, time_s: float) -> tuple[float, float]:
        share = min(max((time_s - self.since_s) * self.mps / math.hypot(*self.way), 0.0), 1.0)
        return self.at[0] + share * self.way[0], self.at[1] + share * self.way[1]


class Glance(NamedTuple):
    """Somebody turns the head aside, and later presses *Look ahead*: seconds since the start, radians."""

    aside_s: float
    pan: float
    ahead_s: float


@dataclass(frozen=True)
class Case:
    """A case to play.

    It ends `longest_s` after the start, `tries_s` after the first try, or after `at_rest_s`.
    """

    world: World
    start: Pose
    driver: Callable[[np.random.Generator], Driver]
    longest_s: float
    at_rest_s: float = 1.0
    tries_s: float = math.inf
    conditions: Conditions = Conditions()
    ends_on_touch: bool = True
    person_starts_s: float | None = None  # when the person in the world begins to walk
    leaving: Leaving | None = None
    glance: Glance | None = None
    arm: ArmShow | None = None  # motions before the stick is touched
    pulls_again: bool = True  # the driver lets go after a refused reverse, and pulls back again


class Loop:
    """One run."""

    def __init__(
        self, case: Case, controller: Callable[[Fan], Controller], limits: Limits, source: str, seed: int
    ) -> None:
        self.case = case
        self.limits = limits
        self._random = np.random.default_rng([seed, 7])
        self._sensors = case.conditions.sensors
        self.robot = Robot(case.world, self._sensors.body(), case.start, seed, case.conditions.drift)
        self._delays = Delays.drawn(self._random)
        self._driver = case.driver(self._random)
        mount = self.robot.laser.mount
        x, y, _, yaw = mount.pose
        fan = Fan(
            source,
            poses.Pose(x, y, yaw),
            -mount.half_angle,
            self.robot.laser.increment,
            mount.shortest_m,
            mount.longest_m,
        )
        self.controller = controller(fan)
        if isinstance(self.controller, GateController):
            self.controller.pulls_again = case.pulls_again
        self.arm = None
        if case.arm and isinstance(self.controller, GateController):
            self.arm = MovingArm(self.robot, self.controller, case.arm)
        self._mux = TwistMux()
        sensors = self._sensors
        self._camera = DepthCamera(
            self._random, sensors.depth_size, sensors.depth_nearest_m, sensors.depth_holes
        )
        self._reader = WorldReader(self.robot.physics)
        self._events: list[tuple[float, int, Callable[[float], None]]] = []
        self._numbers = itertools.count()
        self._phase_ticks = self._random.integers(0, PHASES, 3)  # of scan, sonars and depth
        self._decides_s = STARTS_S + float(self._random.uniform(0.0, PERIOD_S))
        self._command_s = 0.0
        self._frozen_scan: tuple[float, Ranges] | None = None
        self._frozen_odometry: tuple[float, poses.Pose, Velocity] | None = None
        self._sent = STILL
        self._touching: set[str] = set()
        self._still_since_s: float | None = None
        self._tries_since_s: float | None = None
        self._done = False
        self._gap_m = math.inf
        self.trace = Trace()
        self.looks: list[Look] = []  # of sensors that worked
        self._head = Head(structs.replace(tiago_head(), follows_turn=case.conditions.head_pan is None))
        self._pan, self._tilt = case.conditions.head_pan or 0.0, LOOKS_DOWN
        self._aim = Aim(self._pan, self._tilt, AHEAD_TAKES_S)
        self._turns_radps = FOLLOW_RADPS, FOLLOW_RADPS
        self._head_turns = False  # True: it turns so fast that its pictures are not used

    def play(self) -> Trace:
        """Play the run to its end."""
        ticks = 0
        while not self._done:
            now_s = STARTS_S + ticks * TICK_S
            self._fail(now_s)
            self._happen(now_s)
            self._walk(now_s)
            self.robot.tick(now_s)
            self._turn_head(now_s)
            if self.arm:
                self.arm.tick(now_s)
            self._look(now_s + TICK_S)
            self._measure(now_s + TICK_S, ticks)
            ticks += 1
            if now_s - STARTS_S > self.case.longest_s:
                self._done = True
        self.trace.time_s = ticks * TICK_S
        return self.trace

    # --- the world -------------------------------------------------------------------------------

    def _fail(self, now_s: float) -> None:
        for since_s, faults in self.case.conditions.faults:
            if now_s - STARTS_S >= since_s:
                self.robot.faults = faults

    def _walk(self, now_s: float) -> None:
        starts_s = self.case.person_starts_s
        if starts_s is not None and starts_s <= now_s - STARTS_S < starts_s + TICK_S:
            for walker in self.robot.people.values():
                walker.walk()
        if leaving := self.case.leaving:
            place = leaving.place(now_s - STARTS_S)
            if leaving.name in self.robot.people:
                self.robot.people[leaving.name].place(*place)
            else:
                self.robot.physics.place_furniture(leaving.name, *place)

    def _turn_head(self, now_s: float) -> None:
        glance = self.case.glance
        if glance and glance.aside_s <= now_s - STARTS_S:
            if now_s - STARTS_S < glance.ahead_s:
                self._aim_head(Aim(glance.pan, LOOKS_DOWN, AHEAD_TAKES_S))
            elif now_s - STARTS_S < glance.ahead_s + TICK_S:
                controller = self.controller if isinstance(self.controller, GateController) else None
                self._aim_head(
                    self._head.ahead(controller.gate.look_to(now_s) if controller else None, now_s)
                )
            elif onward := self._head.onward(now_s):
                self._aim_head(onward)
        turned, tilted = (
            clamp(there - here, -radps * TICK_S, radps * TICK_S)
            for there, here, radps in zip(self._aim, (self._pan, self._tilt), self._turns_radps, strict=False)
        )
        self._pan += turned
        self._tilt += tilted
        self._head_turns = max(abs(turned), abs(tilted)) > TURNING_RADPS * TICK_S

    def _aim_head(self, aim: Aim) -> None:
        if aim != self._aim:
            ways = aim.pan - self._pan, aim.tilt - self._tilt
            self._turns_radps = abs(ways[0]) / aim.seconds, abs(ways[1]) / aim.seconds
            self._aim = aim

    def _look(self, now_s: float) -> None:
        """Store contacts and the distance driven."""
        moving = self.robot.physics.velocity
        way_m = math.hypot(moving.vx, moving.vy) * TICK_S
        self.trace.way_m += way_m
        self.trace.reverse_m += way_m if moving.vx < 0.0 else 0.0
        if not self.robot.physics.data.ncon:
            self._touching.clear()
            return
        contacts = self.robot.physics.contacts()
        for contact in contacts:
            if contact.other not in self._touching:
                touch = Touch(now_s - STARTS_S, contact.part, contact.other, self.robot.approach, contact.at)
                self.trace.touches.append(touch)
                self._done = self._done or self.case.ends_on_touch
        self._touching = {contact.other for contact in contacts}

    # --- from the robot --------------------------------------------------------------------------

    def _measure(self, now_s: float, ticks: int) -> None:
        """Let the sensors that are due measure now. Their messages arrive later."""
        stamp_s = now_s + ROBOT_CLOCK_S + self.case.conditions.clock_s
        faults = self.robot.faults
        scans, sonars, depths = self._phase_ticks
        if not faults.odom_dead:
            self._tell_odometry(stamp_s, now_s)
        if _is_due(ticks - scans, self._sensors.laser_hz) and not faults.laser_dead:
            self._tell_scan(stamp_s, now_s)
        if _is_due(ticks - sonars, SONAR_HZ) and not faults.sonar_dead:
            self._tell_sonars(stamp_s, now_s)
        looks = self.controller.looks and not faults.depth_dead and not self._head_turns
        if looks and _is_due(ticks - depths, self._sensors.depth_hz):
            self._tell_depth(stamp_s, now_s)

    def _tell_odometry(self, stamp_s: float, now_s: float) -> None:
        odometry = self.robot.odometry
        pose = poses.Pose(float(odometry.x), float(odometry.y), float(odometry.yaw))
        velocity = Velocity(*map(float, odometry.velocity))
        if not self.robot.faults.odom_frozen or self._frozen_odometry is None:
            self._frozen_odometry = stamp_s, pose, velocity
        stamp_s, pose, velocity = self._frozen_odometry
        self._later(
            now_s,
            self._delays.odometry_s,
            lambda at_s: self.controller.odometry(stamp_s, at_s, pose, velocity),
        )

    def _tell_scan(self, stamp_s: float, now_s: float) -> None:
        if not self.robot.faults.laser_frozen or self._frozen_scan is None:
            self._frozen_scan = stamp_s, self._scan()
        stamp_s, ranges = self._frozen_scan
        if self.robot.faults.laser_nan:
            ranges = np.full_like(ranges, np.nan)
        elif not self.robot.faults.laser_frozen:
            self._looked(now_s, LASER, 0.0)
        self._later(now_s, self._delays.scan_s, lambda at_s: self.controller.scan(stamp_s, at_s, ranges))

    def _scan(self) -> Ranges:
        laser = self.robot.laser
        ranges = laser.scan(self.robot.physics)
        ghosts = self._random.random(len(ranges)) < GHOST_SHARE
        ranges[ghosts] = self._random.uniform(0.1, 3.0, int(ghosts.sum()))
        return laser.blanked(ranges) if self.case.conditions.blanked else ranges

    def _tell_sonars(self, stamp_s: float, now_s: float) -> None:
        for sonar in self.robot.sonars:
            frame, range_m = sonar.mount.frame, sonar.range_m(self.robot.physics)
            if range_m < sonar.mount.longest_m:
                self._looked(now_s, frame, range_m)
            self._later(
                now_s,
                self._delays.scan_s,
                lambda at_s, frame=frame, range_m=range_m: self.controller.sonar(  # type: ignore[misc]
                    frame, stamp_s, at_s, range_m
                ),
            )

    def joints(self, pan: float, tilt: float) -> dict[str, float]:
        """Return the joints of the upper body, with this pan and tilt of the head."""
        return {**self.robot.player.positions, "head_1_joint": pan, "head_2_joint": tilt}

    def _tell_depth(self, stamp_s: float, now_s: float) -> None:
        joints = self.joints(self._pan, self._tilt)
        self._reader.follow(self.robot.physics.snapshot())
        self._looked(now_s, DEPTH, self._pan, self._tilt)
        metres = self._camera.image(self._reader, camera_pose(joints))
        to_base = _optical_frame(joints)
        self._later(
            now_s,
            self._delays.depth_s,
            lambda at_s: self.controller.depth(stamp_s, at_s, metres, to_base),
        )

    def _looked(self, now_s: float, sensor: str, reading: float, tilt: float = 0.0) -> None:
        self.looks.append(Look(now_s - STARTS_S, sensor, reading, self.robot.physics.snapshot(), tilt))

    def _later(self, now_s: float, delay_s: float, event: Callable[[float], None]) -> None:
        late_s = self._slowed_s(now_s) + self._jumped_s(now_s, sensors=True)
        at_s = now_s + delay_s + late_s + self._delays.jitter_s * float(self._random.random())
        heapq.heappush(self._events, (at_s, next(self._numbers), event))

    # --- to the robot ----------------------------------------------------------------------------

    def _happen(self, now_s: float) -> None:
        """Carry out all arrivals and decisions that are due, in order of time."""
        while self._decides_s <= now_s or (self._events and self._events[0][0] <= now_s):
            if self._events and self._events[0][0] <= self._decides_s:
                at_s, _, event = heapq.heappop(self._events)
                event(at_s)
            else:
                self._decide(self._decides_s)
                self._decides_s += PERIOD_S

    def _decide(self, now_s: float) -> None:
        pose, moving = self.robot.physics.pose, self.robot.physics.velocity
        time_s = now_s - STARTS_S
        waits = time_s < WARM_UP_S or (self.arm is not None and not self.arm.is_done)
        stick = RELEASED if waits else self._driver.hold(Seen(time_s, pose))
        if stick is None:
            self.trace.arrived = self._done = True
            return
        asked = _asked(stick, self.limits)
        output = self.controller.decide(asked, self._sent, now_s)
        self._sent = output.velocity
        self._command_s = max(self._command_s, self._arrives_s(now_s))
        heapq.heappush(
            self._events,
            (self._command_s, next(self._numbers), lambda at_s: self._obey(output.velocity, at_s)),
        )
        if aim := self._head.follow(self._sent, now_s):
            self._turns_radps = FOLLOW_RADPS, FOLLOW_RADPS
            self._aim = aim
        if len(self.trace.moments) % GAP_EVERY == 0:
            self._gap_m = self.robot.physics.clearance_m()
        self.trace.moments.append(
            Moment(time_s, pose, moving, asked, *output[:3], self._gap_m, stick.trying, output.limits)
        )
        self._end(now_s, stick.trying, output.velocity, moving)

    def _arrives_s(self, now_s: float) -> float:
        delays = self._delays
        jitter_s = delays.jitter_s * float(self._random.random())
        late_s = self.case.conditions.late_s + self._slowed_s(now_s) + self._jumped_s(now_s, sensors=False)
        return now_s + delays.command_s + late_s + jitter_s

    def _slowed_s(self, now_s: float) -> float:
        """Return the delay that a filling queue of the link adds."""
        return min(SLOWS * (now_s - STARTS_S), self.case.conditions.slows_to_s)

    def _jumped_s(self, now_s: float, *, sensors: bool) -> float:
        for at_s, lasts_s in self.case.conditions.hiccups:
            if at_s <= now_s - STARTS_S < at_s + lasts_s:
                return at_s + lasts_s - (now_s - STARTS_S)
        jump = self.case.conditions.jump
        if jump is None or now_s - STARTS_S < jump.at_s or not (jump.sensors if sensors else jump.commands):
            return 0.0
        return jump.by_s

    def _obey(self, velocity: Velocity, now_s: float) -> None:
        if self._mux.passes(INPUT, now_s):
            self.robot.command(Twist(*velocity), now_s)

    def _end(self, now_s: float, trying: bool, sent: Velocity, moving: Twist) -> None:
        """End the run when the robot has stood for `at_rest_s`, or `tries_s` after the first try."""
        if not trying:
            return
        if self._tries_since_s is None:
            self._tries_since_s = now_s
        moves = abs(moving.vx) > 0.005 or abs(moving.w) > 0.02 or abs(sent.vx) > 0.005 or abs(sent.w) > 0.02
        if moves or self._still_since_s is None:
            self._still_since_s = now_s
        rested = now_s - self._still_since_s > self.case.at_rest_s
        self._done = self._done or rested or now_s - self._tries_since_s > self.case.tries_s


def _is_due(ticks: int, hz: float) -> bool:
    """Return whether a sensor of this rate measures at the end of this tick."""
    return math.floor(ticks * hz * TICK_S + 1e-9) > math.floor((ticks - 1) * hz * TICK_S + 1e-9)


def _asked(stick: Stick, limits: Limits) -> Velocity:
    drive = Drive(fence=0, seq=0, sent_ms=0.0, x=stick.x, w=stick.w, share=stick.share)
    return velocity_of(drive, limits, 1.0, "turn")


def _optical_frame(joints: dict[str, float]) -> Transform:
    """Return the transform from the camera's optical frame (right, down, ahead) to the base frame."""
    origin, axes = camera_pose(joints)
    forward, left, up = axes.T
    to_base = np.eye(4)
    to_base[:3, :3] = np.stack((-left, -up, forward), axis=1)
    to_base[:3, 3] = origin
    return to_base
