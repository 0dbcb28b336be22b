"""Cost of a gate decision with few and many points, its share of the drive path, a depth picture, an arm's sweep."""

from __future__ import annotations

import math
import tempfile
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from benchmarks.harness import Figure, progress, quantile
from benchmarks.world.cases import clutter
from benchmarks.world.play import loop_of, recorded
from robots.bridge.gate.arm.sweep import Motion, swept
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.motion.safe_twist import is_still
from robots.bridge.gate.obstacles.depth_camera import frame_of
from robots.bridge.gate.obstacles.obstacle_cache import ObstacleCache
from robots.bridge.gate.sensing.depth import DepthImage, Lens, picture_of_image
from robots.bridge.gate.values import LaserScan
from robots.bridge.gate_trace import replay
from robots.bridge.robot_reports import RosStatus
from robots.shared.configuration.gate_profile import DepthView, GateProfile, Limits
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.verdict import Verdict
from robots.shared.wire import Drive, Grant
from tests.bridge.support import CONFIG, Bench

SEED = 1  # of the recorded minute
DECISIONS = 3000
HELD = 40  # decisions with the same stick position: 0.8 s
LASER = "laser"
PICTURE_US = 1000.0
SWEPT = 50
SWEEP_US = 50_000.0
FIELD_OF_VIEW = math.radians(190)
Floats = NDArray[np.float64]
Outline = tuple[tuple[float, float], ...]
BOX: Outline = ((0.4, -0.25), (0.4, 0.25), (-0.4, 0.25), (-0.4, -0.25))
# Straight on, on an arc, and while the base still turns the other way: from first to last, a decision checks
# more.
STICKS = (Velocity(1.0, 0.0, 0.0), Velocity(0.8, 0.0, 1.2), Velocity(1.0, 0.0, -2.0))


def measure() -> list[Figure]:
    """Return p50 and p99 of the computing time of complete decisions at 50 Hz, with new odometry before each.

    This is not wall time: the time of other processes is not the gate's cost. In the bridge the points are
    moved when odometry comes, so a command waits only for a part: `of which after the command`.
    """
    figures = []
    for hull, outline, limit_us in (("disc", None, 300.0), ("polygon", BOX, 300.0)):
        for where, points, nearest_m, farthest_m in (
            ("in a room", 700, 1.0, 6.0),
            ("all in reach", 700, 0.45, 1.0),
            ("all in reach", 2000, 0.45, 1.0),
        ):
            name = f"{hull}, {points} points {where}"
            progress(name)
            spent = _decisions(outline, points, nearest_m, farthest_m)
            whole_us, command_us = [cost.whole_us for cost in spent], [cost.command_us for cost in spent]
            half_us = limit_us if points == 700 else 800.0
            figures.append(Figure(f"{name}: p50", quantile(whole_us, 0.5), "us", half_us))
            figures.append(Figure(f"{name}: p99", quantile(whole_us, 0.99), "us", 1000.0))
            figures.append(
                Figure(f"{name}: of which after the command: p50", quantile(command_us, 0.5), "us")
            )
    progress("with memory and without")
    figures += _beside_no_memory()
    progress("drive path in a room")
    with_gate_us, without_us = _drive_path()
    added_us = quantile(with_gate_us, 0.5) - quantile(without_us, 0.5)
    figures.append(Figure("added to the drive path in a room, wall time: p50", added_us, "us", 500.0))
    progress("a depth picture, an arm's sweep")
    figures.append(Figure("a depth picture becomes obstacles: p50", _picture_us(), "us", PICTURE_US))
    figures.append(Figure(f"a motion of {SWEPT} points is swept: p50", _sweep_us(), "us", SWEEP_US))
    return figures


def _sweep_us() -> float:
    """Return the computing time (p50) of the space that two links of 0.4 m sweep between random postures."""

    def links_at(joints: Mapping[str, float | Floats]) -> Floats:
        first = np.asarray(joints["shoulder"])
        second = first + joints["elbow"]
        elbow = 0.4 * np.stack((np.cos(first), np.sin(first)), axis=-1)
        tip = elbow + 0.4 * np.stack((np.cos(second), np.sin(second)), axis=-1)
        return np.stack((np.zeros_like(tip), elbow, tip), axis=-2)

    points = np.random.default_rng(SEED).uniform(-1.5, 1.5, (SWEPT, 2))
    motion = Motion(("elbow", "shoulder"), tuple((float(a), float(b)) for a, b in points))
    return _computing_us(lambda: swept(motion, {"elbow": 2.5, "shoulder": 0.0}, links_at, 0.1))


def _computing_us(work: Callable[[], object]) -> float:
    """Return the computing time of `work`, p50."""
    spent_us = []
    for _ in range(40):
        began_ns = time.thread_time_ns()
        work()
        spent_us.append((time.thread_time_ns() - began_ns) / 1000.0)
    return quantile(spent_us, 0.5)


def _picture_us() -> float:
    """Return the computing time (p50) of a noisy picture of floor and wall, from a camera that looks down."""
    lens = Lens.seeing(math.radians(63.0), 640, 480)
    tilt, height_m, wall_m = -0.3, 1.2, 3.0
    down, ahead = (np.arange(480) - lens.cy) / lens.fy, np.array((math.cos(tilt), math.sin(tilt)))
    onwards, upwards = ahead[0] + down * ahead[1], ahead[1] - down * ahead[0]  # of a ray, for 1 m of depth
    depth = np.where(upwards < 0.0, np.fmin(wall_m / onwards, height_m / -upwards), wall_m / onwards)
    rows = np.repeat(depth[:, None], 640, axis=1)
    rows += 0.0015 * rows**2 * np.random.default_rng(SEED).standard_normal(rows.shape)
    message = DepthImage(640, 480, "32FC1", False, 4 * 640, rows.astype("<f4").tobytes())
    to_base = np.eye(4)
    to_base[:3, :3] = ((0.0, ahead[1], ahead[0]), (-1.0, 0.0, 0.0), (0.0, -ahead[0], ahead[1]))
    to_base[:3, 3] = (0.175, 0.0, height_m)
    view = DepthView(height_m=1.1)
    return _computing_us(lambda: frame_of(picture_of_image(message, lens), to_base, view))


def record(path: Path) -> int:
    """Record the gate's input and verdicts during a minute of random stick in clutter, with its near misses.

    MuJoCo moves the robot; see `benchmarks.world`. Return the exit status: 1 if the robot touched something.
    """
    trace = recorded(loop_of(clutter.build(SEED), "gate", SEED), path)
    near_m = min(moment.gap_m for moment in trace.moments)
    progress(
        f"{path}: {len(trace.moments)} decisions, {trace.way_m:.0f} m, nothing nearer than {near_m:.2f} m"
    )
    return 1 if trace.touches else 0


class _Clutter:
    """A gate, and a clutter of objects that its laser sees; each object is seven beams wide."""

    def __init__(
        self,
        outline: Outline | None,
        points: int,
        nearest_m: float,
        farthest_m: float,
        kind: type[Gate] = Gate,
    ) -> None:
        objects = np.random.default_rng(1).uniform(nearest_m, farthest_m, points // 7 + 1)
        self._ranges = objects.repeat(7)[:points]
        self._increment = FIELD_OF_VIEW / (points - 1)
        self.gate = kind(
            GateProfile(
                limits=Limits(1.0, 0.2, 0.0, 2.0944, 1.0, 2.0944),
                radius_m=0.27,
                outline=outline,
                scan_poses={LASER: (0.2, 0.0, 0.0)},
                sonar_poses={},
                sonar_fov={},
                has_depth=False,
                blind_mps=2.0,  # so the blind limit reduces nothing before the points are checked
            )
        )

    def observe(self, turn: int, now_s: float, velocity: Velocity) -> None:
        """Give the gate odometry at 50 Hz, and scans at 10 Hz."""
        self.gate.observe_odometry(now_s, now_s, moved(turn), velocity)
        self.scan(turn, now_s)

    def scan(self, turn: int, now_s: float) -> None:
        """Give the gate a scan on every fifth turn."""
        if turn % 5 == 0:
            start = -FIELD_OF_VIEW / 2.0
            scan = LaserScan(LASER, now_s, now_s, self._ranges, start, self._increment, 0.05, 25.0)
            self.gate.observe_scan(scan)


def moved(turn: int) -> Pose:
    """Return a pose that changes slightly each turn: real odometry never repeats exactly."""
    return Pose(1e-5 * (turn % 100), 0.0, 0.0)


class Cost(NamedTuple):
    """Cost of one decision: the whole, with the work for new odometry, and the part that delays a command."""

    whole_us: float
    command_us: float


class _TimedGate(Gate):
    """Stores the cost of each decision, except decisions without motion asked."""

    def __init__(self, profile: GateProfile) -> None:
        super().__init__(profile)
        self.spent: list[Cost] = []

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Verdict:
        began_s = time.thread_time()
        self.prepare(now_s)
        prepared_s = time.thread_time()
        verdict = super().decide(asked, sent, now_s)
        decided_s = time.thread_time()
        if not is_still(asked):
            self.spent.append(Cost(1e6 * (decided_s - began_s), 1e6 * (decided_s - prepared_s)))
        return verdict


class _GateWithoutMemory(_TimedGate):
    """Decides only by the present sensor data."""

    def __init__(self, profile: GateProfile) -> None:
        super().__init__(profile)
        self._sources = self._sensors
        self._cache = ObstacleCache(self._sources, self._trail)


def _decisions(outline: Outline | None, points: int, nearest_m: float, farthest_m: float) -> list[Cost]:
    """Return the cost of each complete decision. The base obeys 0.1 s later."""
    clutter = _Clutter(outline, points, nearest_m, farthest_m, _TimedGate)
    gate = cast(_TimedGate, clutter.gate)
    on_its_way = deque([STILL] * 5)
    for turn in range(DECISIONS):
        stick, now_s = STICKS[turn // HELD % len(STICKS)], 1.0 + turn / 50.0
        clutter.observe(turn, now_s, on_its_way.popleft())
        verdict = gate.decide(stick, on_its_way[-1], now_s)
        on_its_way.append(verdict.velocity)
        if verdict.neutral:
            raise RuntimeError(f"the gate saw nothing to decide upon: {verdict.text}")
    return gate.spent


def _beside_no_memory() -> list[Figure]:
    """Replay a recorded minute of random stick in clutter with laser, sonars and depth pictures.

    Return the cost of decisions with memory, also relative to the cost without memory.
    """
    with tempfile.TemporaryDirectory(prefix="bench-gate-") as folder:
        path = Path(folder) / "minute"
        recorded(loop_of(clutter.build(SEED), "gate", SEED), path)
        spent: dict[type[_TimedGate], list[Cost]] = {}

        def gate_of(kind: type[_TimedGate]) -> Callable[[GateProfile], Gate]:
            def make(profile: GateProfile) -> Gate:
                gate = kind(profile)
                spent[kind] = gate.spent
                return gate

            return make

        kinds = _TimedGate, _GateWithoutMemory
        # The gates decide in turn, decision by decision.
        for _ in zip(*(replay(path, gate_of(kind)) for kind in kinds), strict=True):
            pass
    figures = []
    for name, number in (("a decision in clutter", 0), ("of which after the command", 1)):
        remembers_us, forgets_us = (quantile([cost[number] for cost in spent[kind]], 0.5) for kind in kinds)
        figures.append(Figure(f"{name}, with memory: p50", remembers_us, "us"))
        figures.append(Figure(f"{name}, with memory / without: p50", remembers_us / forgets_us, "times", 1.5))
    return figures


class _OpenGate(Gate):
    """Receives the same data as a gate, and allows every command."""

    def decide(self, asked: Velocity, sent: Velocity, now_s: float) -> Verdict:
        return Verdict(asked, asked, "free", "")


def _drive_path() -> tuple[list[float], list[float]]:
    """Return times from a stick position at the core to the twist at the base, with gate and without, us.

    These are wall times. Both are measured in turn, 50 times per second of the robot's time, in a room of 700
    points.
    """
    with_gate, without = (_Path(_Clutter(None, 700, 1.0, 6.0, kind)) for kind in (Gate, _OpenGate))
    for turn in range(DECISIONS):
        for path in (with_gate, without):
            path.step(turn, 1.0 + turn / 50.0)
    return with_gate.spent_us, without.spent_us


class _Path:
    """A core with a grant, and its base, which carries out each twist 0.1 s later."""

    def __init__(self, clutter: _Clutter) -> None:
        self.spent_us: list[float] = []
        self._clutter = clutter
        self._on_its_way = deque([STILL] * 5)
        bench = Bench(config=structs.replace(CONFIG, gate=clutter.gate.profile), gate=clutter.gate)
        self._base, self._core = bench.base, bench.core
        self._core.ros_status(RosStatus("connecting", ""), 0.0)
        self._core.grant(Grant(1, 2.0 * DECISIONS, "session", "Ann", "ann", 1.0), 1, 0.0)

    def step(self, turn: int, now_s: float) -> None:
        """Give sensor data to the core, then the stick: first neutral, then the most expensive positions."""
        self._core.odometry(now_s, now_s, moved(turn), self._on_its_way.popleft(), now_s)
        self._clutter.gate.prepare(now_s)
        self._clutter.scan(turn, now_s)
        stick = STICKS[turn // HELD % len(STICKS)] if turn >= HELD else STILL
        limits = self._clutter.gate.profile.limits
        x, w = stick.vx / limits.forward_mps, stick.w / limits.turn_radps
        drive = Drive(fence=1, seq=turn + 1, sent_ms=1000.0 * now_s, x=x, w=w, share=1.0)
        before = time.perf_counter()
        refusal = self._core.drive(drive, 1, now_s)
        spent_us = 1e6 * (time.perf_counter() - before)
        newest = self._base.sent[-1] if self._base.sent else STILL
        self._on_its_way.append(newest)
        if refusal is not None:
            raise RuntimeError(f"nothing was driven: {refusal.text}")
        if newest != STILL:
            self.spent_us.append(spent_us)
