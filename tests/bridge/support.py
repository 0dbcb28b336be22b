"""Test bench for the bridge's core: a recording base, an open gate, and a clock set by the test."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace

import msgspec
import numpy as np

from robots.bridge.audit.records import Records
from robots.bridge.core import Core
from robots.bridge.drive.drive_log import DriveLog
from robots.bridge.gate.arm.discs import Disc
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.sensor_limits import Fault
from robots.bridge.gate.timing.latency import Latency
from robots.bridge.gate.values import ForgetCode, Forgotten, Obstacles, SensorHealth
from robots.bridge.head.head import Aim
from robots.bridge.lease.state_store import SavedState
from robots.bridge.navigation.localisation import Spread
from robots.bridge.robot_reports import RosStatus
from robots.bridge.tasks.motions import Swept
from robots.bridge.tasks.speech import Utterance
from robots.shared import wire
from robots.shared.configuration.bridge_config import (
    Allowed,
    BridgeConfig,
    HeadSource,
    LimbSource,
    LinkAddress,
    NavigationSource,
    Topic,
    Topics,
)
from robots.shared.configuration.gate_profile import GateProfile, Limits
from robots.shared.configuration.robot_ros import Ros1
from robots.shared.geometry.planar import NO_POINTS, Points
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.record_sink import (
    DriveSummary,
    GateStart,
    GateSummary,
    Holder,
    Parameters,
    Position,
    RecordError,
    RecordSink,
)
from robots.shared.records.verdict import SpeedLimit, Verdict
from robots.shared.wire import Drive, Ended, Grant, Refusal

LIMITS = Limits(1.0, 0.2, 0.0, 2.0, 1.0, 2.0)
CONFIG = BridgeConfig(
    robot_id="0" * 32,
    slug="tiago",
    name="Tiago",
    ros=Ros1("http://localhost:11311"),
    topics=Topics(
        drive=Topic("/key_vel", "geometry_msgs/Twist"),
        odometry=Topic("/odom", "nav_msgs/Odometry"),
        speech=Topic("/tts", "pal_interaction_msgs/TtsAction"),
        languages=["en-GB", "es-ES"],
        motions=Topic("/play_motion", "play_motion_msgs/PlayMotionAction"),
    ),
    gate=GateProfile(LIMITS, 0.27, None, {}, {}, {}, False, 0.3),
    reverse_steering="turn",
    link=LinkAddress(),
    state_dir="unused",
)


class OpenGate:
    """A gate that allows everything unless a test says otherwise. It uses odometry like the real gate."""

    def __init__(self, profile: GateProfile) -> None:
        self._real = real = Gate(profile)
        self.observe_odometry, self.standstill = real.observe_odometry, real.standstill
        self.odometry_is_stale = real.odometry_is_stale
        self.footprint, self.profile = real.footprint, profile
        self.seen: list[tuple[float, float]] = []  # points of the laser
        self.pictured: list[tuple[float, float]] = []  # points of the depth camera
        self.health: list[SensorHealth] = []
        self.says: Callable[[Velocity], Verdict] | None = None
        self.misses: Fault | None = None  # missing data, which forbids all motion
        self.latency = Latency(LIMITS, 0.2)
        self.arm_discs: tuple[tuple[float, float, float], ...] = ()
        self.operator_delay_s: float | None = None
        self.velocity = STILL  # measured
        self.looks = True  # the depth camera looks ahead
        self.drivers = 0  # how many took control
        self.forgot: list[bool] = []  # calls of `forget`, each with `restarted`
        self.forgotten: Forgotten | None = None

    @property
    def restarts(self) -> int:
        return self._real.restarts + sum(self.forgot)

    def observe_lost_limb(self, limb: str | None) -> None:
        self.lost_limb = limb

    def look_to(self, now_s: float) -> float | None: ...

    def looks_ahead(self, now_s: float) -> bool:
        return self.looks

    def unwatched(self, now_s: float) -> SpeedLimit | None: ...

    def forget(self, restarted: bool = False, code: ForgetCode = "asked") -> None:
        self.forgot.append(restarted)
        self.forgotten = Forgotten(len(self.forgot), code)

    def observe_new_driver(self) -> None:
        self.drivers += 1

    def observe_camera_view(self, age_s):
        """Ignore it."""

    def observe_operator(self, delay_s: float | None) -> None:
        self.operator_delay_s = delay_s

    def observe_acknowledgement(self, took_s: float, now_s: float) -> None:
        self.latency.acknowledged(took_s, now_s)

    def observe_range(self, *_observation: object) -> None: ...

    def prepare(self, _now_s: float) -> None: ...

    def unseen(self, _now_s: float) -> list[tuple[float, float]]:
        return []

    def limits(self, _now_s: float) -> tuple[SpeedLimit, ...]:
        return ()

    def fault(self, _now_s: float) -> Fault | None:
        return self.misses

    def hears_all(self, _now_s: float) -> bool:
        return self.misses is None

    def decide(self, asked: Velocity, _sent: Velocity, _now_s: float) -> Verdict:
        if asked != STILL and self.misses:
            return Verdict(STILL, asked, self.misses.code, f"stopped: {self.misses.text}", neutral=True)
        if asked != STILL and self.says:
            return self.says(asked)
        return Verdict(asked, asked, "idle" if asked == STILL else "free", "")

    def obstacles(self, _now_s: float) -> Obstacles:
        points = np.array([*self.seen, *self.pictured], float).reshape(-1, 2)
        source = np.repeat([0, 1], [len(self.seen), len(self.pictured)])
        return Obstacles(points, source, ("laser", "depth"), ("scan", "depth"))

    obstacles_as_seen = obstacles

    def unseen_near_sides(self) -> Points:
        return NO_POINTS

    def sensor_health(self, _now_s: float) -> list[SensorHealth]:
        return list(self.health)


@dataclass
class MemoryBase:
    """A base that records its commands."""

    now: Callable[[], float]
    sent: list[Velocity] = field(default_factory=list)
    aims: list[Aim] = field(default_factory=list)
    head: tuple[float, float] | None = None
    head_goal: str | None = None  # what the robot's head action calls the next aims
    sweeps: dict[str, tuple[Disc, ...]] = field(default_factory=dict)
    asked: list[Callable[[], None]] | None = None  # if a list: the robot's answers about motions wait in it
    lies: tuple[Disc, ...] | None = None  # discs of the arm, by joint states
    arm_trouble: str = ""  # why the arm's position is unknown
    echo_s: float | None = None  # delay of its acknowledgement of a twist
    played: list[tuple[str, str]] = field(default_factory=list)
    cancelled_goals: list[str] = field(default_factory=list)
    said: list[tuple[str, Utterance]] = field(default_factory=list)
    tells: bool = True  # whether the robot reports the end of texts
    goals: list[tuple[str, Pose]] = field(default_factory=list)  # of navigation
    poses: list[Pose] = field(default_factory=list)  # estimates that were set for localisation
    transform: tuple[float, Pose] | None = None  # of localisation
    limbs: dict[str, float] = field(default_factory=dict)  # positions, m
    joints: dict[str, float] = field(default_factory=dict)  # positions by name, rad or m
    limbs_heard: bool = True
    moves: list[tuple[str, str, float, float]] = field(default_factory=list)
    attended: list[tuple[str, frozenset[str]]] = field(default_factory=list)
    switched: list[tuple[str, int]] = field(default_factory=list)  # topic, and number of twists before
    readings: int = 0  # how often its motions were read
    cancelled: int = 0
    listeners: int = 1
    waiting: list[Callable[[], None]] = field(default_factory=list)  # messages that wait for the event loop

    def part(self, kind: type) -> object:
        """This base does all that a part of the robot may do."""
        return self

    def publish(self, velocity: Velocity) -> None:
        self.sent.append(velocity)

    def joint(self, name: str) -> float | None:
        return self.joints.get(name)

    def take_odometry(self) -> None:
        while self.waiting:
            self.waiting.pop(0)()

    def take_waiting(self) -> None:
        self.take_odometry()

    def acknowledged_s(self, now_s: float) -> float | None:
        return self.echo_s

    def cancel_all(self) -> None:
        self.cancelled += 1

    def aim_head(self, aim: Aim) -> str | None:
        self.aims.append(aim)
        return self.head_goal

    def head_at(self) -> tuple[float, float] | None:
        return self.head

    def sweep(self, motion: str, action: str, then: Swept) -> None:
        if self.asked is None:
            then(self.sweeps.get(motion), self.now())
        else:
            self.asked.append(lambda: then(self.sweeps.get(motion), self.now()))

    def arm(self) -> tuple[Disc, ...] | None:
        return self.lies

    def arm_problem(self) -> str:
        return self.arm_trouble

    def read_motions(self) -> None:
        self.readings += 1

    def play(self, goal_id: str, motion: str, action: str) -> None:
        self.played.append((goal_id, motion))

    def cancel(self, goal_id: str, action: str) -> None:
        self.cancelled_goals.append(goal_id)

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        self.said.append((goal_id, utterance))
        return self.tells

    def cancel_speech(self, goal_id: str, topic: str) -> None:
        self.cancelled_goals.append(goal_id)

    def navigates(self) -> bool:
        return True

    def go(self, goal_id: str, goal: Pose) -> None:
        self.goals.append((goal_id, goal))

    def cancel_navigation(self, goal_id: str) -> None:
        self.cancelled_goals.append(goal_id)

    def set_pose(self, pose: Pose) -> None:
        self.poses.append(pose)

    def located(self) -> tuple[float, Pose] | None:
        return self.transform

    def limb_at(self, limb: str) -> float | None:
        return self.limbs.get(limb)

    def limb_has_listener(self, limb: str) -> bool:
        return self.limbs_heard

    def move_limb(self, limb: str, goal_id: str, to_m: float, seconds: float) -> None:
        self.moves.append((limb, goal_id, to_m, seconds))

    def cancel_limb(self, limb: str, goal_id: str) -> None:
        self.cancelled_goals.append(goal_id)

    def attend(self, use: str, topics: frozenset[str]) -> None:
        self.attended.append((use, topics))

    def drive_to(self, topic: str) -> None:
        self.switched.append((topic, len(self.sent)))


class Outcome(SimpleNamespace):
    """A recorded outcome, with its parameters as attributes."""

    def __init__(self, outcome: str, **parameters: object) -> None:
        super().__init__(outcome=outcome, **parameters)


class MemorySink:
    """A sink that stores records; `fails` makes it refuse; while `open` is not set, it waits."""

    def __init__(self) -> None:
        self.records: list[tuple[str, object]] = []
        self.pulses = 0
        self.ill: dict[str, wire.HealthLevel] = {}  # parts that an earlier bridge recorded
        self.stops: list[tuple[Holder | None, int]] = []
        self.fails: str | None = None
        self.open = threading.Event()
        self.open.set()

    def _wait(self) -> None:
        self.open.wait(10)
        if self.fails:
            raise RecordError(self.fails)

    def _record(self, kind: str, what: object) -> int:
        self._wait()
        self.records.append((kind, what))
        return len(self.records)

    def settle(self) -> None:
        self._record("settled", None)

    def test_writable(self) -> None:
        self._wait()
        self.pulses += 1

    def ill_parts(self) -> dict[str, wire.HealthLevel]:
        self._wait()
        return self.ill

    def stopped(self, holder: Holder | None, number: int, was_standing: bool) -> None:
        self._wait()
        self.stops.append((holder, number))

    def begin_drive(self, holder: Holder, start: Position) -> int:
        return self._record("drive.start", start)

    def end_drive(self, drive: int, holder: Holder, summary: DriveSummary) -> None:
        self._record("drive.end", summary)

    def request(self, holder: Holder | None, kind: str, parameters: Parameters) -> int:
        return self._record(kind, parameters)

    def outcome(
        self, request: int, holder: Holder | None, kind: str, outcome: str, parameters: Parameters
    ) -> None:
        self._record(kind, Outcome(outcome, **parameters))

    def begin_gate(self, drive: int, holder: Holder, start: GateStart) -> int:
        return self._record("gate.begin", start)

    def end_gate(self, intervention: int, holder: Holder, summary: GateSummary) -> None:
        self._record("gate.end", summary)

    @property
    def kinds(self) -> list[str]:
        return [kind for kind, _ in self.records]


class MemoryPublisher:
    """A publisher that accepts all fields by default."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self.fault: Refusal | None = None
        self.is_there = True
        self.published: list[wire.Publish] = []
        self.stopped: list[str] = []
        self.halts = 0
        self.kept_alive = 0
        self.waiting: list[Callable[[], None]] | None = None  # if a list: the answers wait in it

    def check(self, order: wire.Publish, then: Callable[[Refusal | None, float], None]) -> None:
        if self.waiting is None:
            then(self.fault, self._now())
        else:
            self.waiting.append(lambda: then(self.fault, self._now()))

    def publish(self, order: wire.Publish) -> bool:
        if self.is_there:
            self.published.append(order)
        return self.is_there

    def publish_stop(self, topic: str) -> None:
        self.stopped.append(topic)

    def halt(self) -> None:
        self.halts += 1

    def keep_alive(self) -> None:
        self.kept_alive += 1


class Bench:
    """A core and its surroundings, controlled by the test."""

    def __init__(
        self,
        left: SavedState | None = None,
        config: BridgeConfig = CONFIG,
        sink: RecordSink | None = None,
        gate: Gate | None = None,
    ) -> None:
        self.now_s = 100.0
        self.base = MemoryBase(lambda: self.now_s)
        self.gate = OpenGate(config.gate)
        self.sink = MemorySink()
        self.publisher = MemoryPublisher(lambda: self.now_s)
        self.records = Records(sink or self.sink)
        self.drives = DriveLog(self.records, lambda: self.map_to_odom)
        self.notices: list[Ended | wire.Offers] = []  # to every link
        state = left or SavedState(False, "", "", 0)
        self.core = Core(
            config,
            self.base,
            gate or self.gate,  # type: ignore[arg-type]
            self.records,
            self.drives,
            state,
            self.notices.append,
            self.publisher,
            on_news=self._count_news,
            on_wake=lambda: self.wakes.append(self.now_s),
        )
        self.wakes: list[float] = []  # when a rest ended
        self.news = 0  # sensor messages while a person had control
        self.seq = 0
        self.stamp_s = 50.0  # stamp of the newest odometry, by the robot's clock
        self.speed = STILL
        self.x = self.yaw = 0.0
        self.map_to_odom: Pose | None = None

    def _count_news(self) -> None:
        self.news += 1

    def close(self) -> None:
        """End the bridge."""
        self.core.close(self.now_s)
        self.records.close()

    def online(self) -> Bench:
        """Connect to the robot's master; odometry arrives."""
        self.core.ros_status(RosStatus("connecting", ""), self.now_s)
        self.odometry()
        return self

    def odometry(self, speed: Velocity | None = None) -> None:
        if speed is not None:
            self.speed = speed
        self.stamp_s += 0.001
        self.frozen_odometry()

    def frozen_odometry(self) -> None:
        """Repeat the last odometry message with its stamp."""
        self.core.odometry(self.stamp_s, self.now_s, Pose(self.x, 0.0, self.yaw), self.speed, self.stamp_s)

    def granted(self, fence: int = 1, seconds: float = 60.0, link: int = 1) -> Bench:
        """Give control to Ann, with her stick in the middle."""
        grant = Grant(fence, seconds, f"session-{fence}", "Ann", "ann-id", 1.0)
        self.core.grant(grant, link, self.now_s)
        assert self.stick(0.0, fence=fence, link=link) is None
        return self

    def stick(
        self, x: float, w: float = 0.0, fence: int = 1, link: int = 1, age_s: float = 0.0
    ) -> Refusal | None:
        self.seq += 1
        sent_ms = (self.now_s - age_s) * 1000
        drive = Drive(fence=fence, seq=self.seq, sent_ms=sent_ms, x=x, w=w, share=1.0)
        return self.core.drive(drive, link, self.now_s)

    def order(self, order: wire.TaskRequest, link: int = 1) -> Refusal | None:
        """Send a task of the holder's page; return an immediate refusal."""
        answers = self.ask(order, link)
        return answers[0] if answers else None

    def ask(self, order: wire.TaskRequest, link: int = 1) -> list[Refusal | None]:
        """Send a task of the holder's page; return its one answer, immediate or later."""
        answers: list[Refusal | None] = []
        self.core.tasks.take(order, link, self.now_s, answers.append)
        return answers

    def recorded(self) -> None:
        """Wait until all records so far are written."""
        done = threading.Event()
        self.records.run_in_background(done.set)
        assert done.wait(10)

    def driving(self, x: float = 0.5) -> Bench:
        """Drive forward; the robot obeys."""
        self.stick(x)
        self.recorded()
        self.pass_time(0.02)
        assert self.stick(x) is None
        assert self.last.vx > 0
        return self

    def pass_time(self, seconds: float) -> None:
        """Let time pass in ticks of 50 ms, with odometry."""
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-9:
            self.now_s = min(self.now_s + 0.05, until_s)
            self.odometry()
            self.core.tick(self.now_s)
            if self.sink.open.is_set():
                self.recorded()  # time passes faster here than records are written

    @property
    def last(self) -> Velocity:
        return self.base.sent[-1]


# A request of each kind of task, by the kind's name.
ORDERS: dict[str, wire.TaskRequest] = {
    "motion": wire.Play(1, "wave"),
    "publish": wire.Publish(1, "/notes", "std_msgs/String", {"data": "hello"}, 5.0),
    "look_ahead": wire.LookAhead(1),
    "turn_head": wire.TurnHead(1, 0.1, 0.0),
    "speech": wire.Say(1, "Hello", "en-GB"),
    "choose": wire.Choose(1, "drive", "/phone_vel"),
    "drive_by": wire.DriveBy(1, distance_m=1.0),
    "go": wire.Go(1, 3.0, 1.0, 0.5),
    "set_pose": wire.SetPose(1, 0.1, 0.0, 0.0),
    "limb": wire.MoveLimb(1, "gripper", 0.09),
    "forget": wire.Forget(1),
}


class FreeMap:
    """A map without obstacles."""

    def __init__(self, digest: str = "free") -> None:
        self.digest = digest

    def refuse(self, goal: Pose, footprint: object) -> None: ...


class ObedientBench(Bench):
    """A bench whose robot has every capability, does what `ORDERS` request, as soon as the bridge allows it, and
    reports it."""

    def __init__(self) -> None:
        allowed = (
            Allowed("publish", "/notes", "std_msgs/String"),
            Allowed("choose", "/phone_vel", "geometry_msgs/Twist", "drive"),
        )
        topics = msgspec.structs.replace(
            CONFIG.topics,
            head=HeadSource("/head_controller/command", "head_1_joint", "head_2_joint"),
            navigation=NavigationSource("/move_base", "/nav_vel", "/amcl_pose", set_pose="/initialpose"),
            map=Topic("/map", "nav_msgs/OccupancyGrid"),
            gripper=LimbSource("/gripper/follow_joint_trajectory", ["left", "right"], (0.0, 0.045), 0.05),
        )
        super().__init__(config=msgspec.structs.replace(CONFIG, topics=topics, allowed=allowed))
        self.base.limbs = {"gripper": 0.04}
        self.online().base.sweeps = {"wave": ()}
        self.core.tasks.navigation.mapped(FreeMap(), self.now_s)
        self.core.tasks.navigation.localisation.posed(
            Pose(0.0, 0.0, 0.0), Spread(0.01, 0.0, 0.01, 0.01), self.now_s
        )
        self.granted().pass_time(0.3)

    def frozen_odometry(self) -> None:
        self.base.transform = (self.now_s, Pose(0.0, 0.0, 0.0))
        super().frozen_odometry()

    def obeys(self) -> None:
        """Write the records, then let the robot do what was requested."""
        self.recorded()
        self.core.recorded(self.now_s)
        for use, topics in self.base.attended:
            self.core.tasks.routing.attended(use, topics, self.now_s)
        self.base.attended.clear()
        self.core.tick(self.now_s)
        self.recorded()

    def reports(self, obeys: bool = True) -> None:
        """Let the robot report its goals: one that was cancelled ends, unless it has not obeyed yet."""
        tasks, now_s = self.core.tasks, self.now_s
        over = self.base.cancelled_goals if obeys else []
        begun = [
            (tasks.motions, "/play_motion", self.base.played),
            (tasks.speech, "/tts", self.base.said),
            (tasks.navigation, "/move_base", self.base.goals),
        ]
        for part, action, goals in begun:
            for goal_id, _ in goals:
                if goal_id in over:
                    part.ended(goal_id, "cancelled", "", now_s)
                else:
                    part.running(action, {goal_id: "speaking"}, now_s)
        for limb, goal_id, *_ in self.base.moves:
            if goal_id in over:
                tasks.limbs.move(limb).ended(goal_id, "cancelled", "", now_s)
            else:
                tasks.limbs.move(limb).running({goal_id: True}, now_s)

    @property
    def goals(self) -> list[str]:
        """Ids of the goals that were sent to the robot."""
        base = self.base
        begun = [goal_id for goals in (base.played, base.said, base.goals) for goal_id, _ in goals]
        return begun + [goal_id for _, goal_id, *_ in base.moves]

    @property
    def begun(self) -> list[object]:
        """Everything that has begun on the robot."""
        base, drives = self.base, self.core.tasks.drives_by
        at_once = [*self.publisher.published, *base.poses, *self.gate.forgot, *base.switched]
        goals = [*base.played, *base.said, *base.goals, *base.moves]
        looks = [] if base.goals else base.aims  # the head looks where a goal leads
        driven = drives.running_requester is not None or drives.last is not None
        return [*at_once, *goals, *looks, *(["driven"] if driven else [])]


class Wire:
    """One end of a link, without a socket."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.greeted = False
        self.reports: list[object] = []
        self.ended = False
        self.news = asyncio.Event()

    def report(self, message: object) -> None:
        self.reports.append(message)
        self.news.set()

    def close_when_sent(self) -> None:
        self.ended = True

    async def hears(self, message: object) -> None:
        while message not in self.reports:
            self.news.clear()
            await asyncio.wait_for(self.news.wait(), 10)


def settled(bench: Bench) -> None:
    """Write the records so far, run a tick, and write its records."""
    bench.recorded()
    bench.core.tick(bench.now_s)
    bench.recorded()


def codes(answers: Sequence[Refusal | None]) -> list[str | None]:
    """The answers' refusal codes; None for a success."""
    return [refusal.code if refusal else None for refusal in answers]


def runs_out(bench: Bench) -> None:
    """Block the loop for so long that the grant expires."""
    bench.granted(seconds=0.3)
    bench.now_s += 0.5
