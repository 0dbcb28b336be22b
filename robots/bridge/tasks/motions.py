"""Perform one motion of the robot at a time: request, record, start, checks, end, record of the end.

While the request is recorded, the robot is asked for the motion's points. The motion starts when both are done.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import msgspec
from msgspec import Struct

from robots.bridge.arm.clearance import ArmClearance, ArmModel
from robots.bridge.audit.records import Requester
from robots.bridge.gate.arm.discs import Disc
from robots.bridge.gate.arm.sweep import Motion
from robots.bridge.tasks.goals import OURS, UNHEARD_S, Goal, Goals
from robots.bridge.tasks.input_routing import InputRouting
from robots.bridge.tasks.task import WHILE_HELD, Activity, Context, Ending, TaskPart
from robots.bridge.watchdog.rules import CANCEL_AGAIN_S
from robots.shared import wire
from robots.shared.records.record_sink import Parameters
from robots.shared.sentences import say
from robots.shared.wire import Grant, Refusal

FARTHEST = 100.0  # rad or m: no joint of an arm goes farther
# Limit of unwatched goals in memory: any node on the robot's network can invent goal ids.
MOST_LEFT = 3
PATIENCE_S = 3.0  # time limit for the motion's points; then the person may ask again
NO_MOTIONS = Refusal("not_offered", "This robot takes no input for motions.", "robot")
# Outcome of a motion, by the code of the refusal that ends it.
_OUTCOMES = {"motion_blocked": "intruder", "not_watched": "not_watched"}
# Reasons why a motion forbids other activities.
_REASONS = {
    Activity.TURN_HEAD: Refusal(
        "motion_running", "The robot performs a motion, which may move its head.", "robot"
    ),
    Activity.FORGET: Refusal(
        "motion_running", "The robot performs a motion, which needs the gate’s memory.", "robot"
    ),
}


class _Point(Struct):
    positions: list[float]


class _MotionPoints(Struct):
    """The part of a motion's parameters that gives its points."""

    joints: list[str]
    points: list[_Point]


class _Time(Struct):
    time_from_start: float


class _Meta(Struct, frozen=True):
    name: str = ""
    usage: str = ""
    description: str = ""


class _MotionTexts(Struct):
    """The part of a motion's parameters for people."""

    meta: _Meta = _Meta()
    points: list[_Time] = []


# Create decoders before threads start: see robots/registry/configuration/profile_schema.py.
for _kind in (_MotionPoints, _MotionTexts):
    msgspec.json.Decoder(_kind)


def recorded(parameters: Any, listed: Collection[str] | None = None) -> dict[str, Motion | None]:
    """Return a robot's motions by name, from play_motion's parameters; None for a motion without known points.

    `listed`: the motions that the robot's service returns; None: return all that have parameters.
    """
    by_name = _by_name(parameters)
    return {name: _recorded(by_name.get(name)) for name in sorted(by_name if listed is None else listed)}


def offered(parameters: Any, listed: Mapping[str, float] | None = None) -> list[wire.MotionOffer]:
    """Return the same motions as `recorded`, for people. `listed`: their durations in seconds; 0: unknown."""
    by_name = _by_name(parameters)
    durations = listed or {}
    names = sorted(by_name if listed is None else listed)
    return [_offer(name, by_name.get(name), durations.get(name, 0.0)) for name in names]


def _by_name(parameters: Any) -> dict[str, Any]:
    return {str(name): value for name, value in parameters.items()} if isinstance(parameters, dict) else {}


def _recorded(parameters: Any) -> Motion | None:
    try:
        motion = msgspec.convert(parameters, _MotionPoints)
    except msgspec.ValidationError:
        return None
    points = tuple(tuple(point.positions) for point in motion.points)
    fit = all(len(point) == len(motion.joints) and all(map(_possible, point)) for point in points)
    return Motion(tuple(motion.joints), points) if points and fit else None


def _possible(position: float) -> bool:
    """Return whether a joint can be there; False if it is not a number."""
    return abs(position) <= FARTHEST


def _offer(name: str, parameters: Any, duration_s: float) -> wire.MotionOffer:
    try:
        known = msgspec.convert(parameters, _MotionTexts)
    except msgspec.ValidationError:
        known = _MotionTexts()
    if not duration_s and known.points:
        duration_s = known.points[-1].time_from_start
    meta = known.meta
    return wire.MotionOffer(
        name=name,
        title=meta.name or name,
        usage=meta.usage,
        description=meta.description,
        duration_s=round(duration_s, 1) if 0.0 < duration_s < math.inf else None,
    )


# A callback, called later on the event loop. Arguments: the space that the arm sweeps from its present
# position (None: the action has no such motion), and the time.
Swept = Callable[[tuple[Disc, ...] | None, float], None]


class MotionPlayer(ABC):
    """Performs motions."""

    @abstractmethod
    def play(self, goal_id: str, motion: str, action: str) -> None:
        """Send the goal."""

    @abstractmethod
    def cancel(self, goal_id: str, action: str) -> None:
        """Cancel this goal and no other."""

    @abstractmethod
    def read_motions(self) -> None:
        """Ask the robot for its motions. Returns at once; `Capabilities.read` follows for each action."""

    @abstractmethod
    def sweep(self, motion: str, action: str, then: Swept) -> None:
        """Ask the robot for a motion's present points; call `then` with the space that the arm would sweep.

        Returns at once. If the points have changed, the list of motions is read again. If the action had no subscriber
        at the last survey, `InputRouting.surveyed` is called first with the present subscribers.
        """


@dataclass
class MotionGoal:
    """A motion to perform and the space that its arm sweeps; None: not known yet."""

    name: str
    title: str  # for people
    space: Sequence[Disc] | None = None


@dataclass
class _UnwatchedGoal:
    """A goal that nobody watches; it is cancelled until the robot obeys."""

    record: Future[int]
    heard_s: float
    outcome: str = "unheard"  # until the robot reports how it ended


class Motions(Goals[MotionGoal], TaskPart):
    """The motion in progress, if any."""

    kinds = (wire.MOTION,)
    reactions = WHILE_HELD
    excludes = frozenset(Activity)
    no_task = Refusal("no_motion", "No motion of this console runs.", "robot")
    neutral_words = {"motion_running": say("nothing drives during a motion")}

    def __init__(self, context: Context) -> None:
        super().__init__(context.records, self._cancel_on_robot)
        self._context = context
        self._clearance = ArmClearance(context.gate, lambda: context.robot.part(ArmModel))
        self.last: wire.MotionEnd | None = None  # how the last motion ended, for pages
        # Actions with goals that nobody watches, with the time of the last cancel.
        self._unwatched_actions: dict[str, float] = {}
        # Such goals whose cancels are recorded, by id: at most `MOST_LEFT`.
        self._unwatched_goals: dict[str, _UnwatchedGoal] = {}

    def _cancel_on_robot(self, goal_id: str, action: str) -> None:
        if player := self._context.robot.part(MotionPlayer):
            player.cancel(goal_id, action)

    # --- rules ----------------------------------------------------------------------------------------

    def take(self, order: wire.Play, grant: Grant, requester: Requester, now_s: float) -> None:
        """Record the motion and read its present points in parallel, because both take a while."""
        refusal = self.refuse(now_s) or self._why_not(requester, None, now_s)
        # The last survey is seconds old: a subscriber may have joined since.
        if refusal is not None and refusal.code != "no_listener":
            requester.answer(refusal)
            return
        player = self._context.robot.part(MotionPlayer)
        if player is None:
            requester.answer(NO_MOTIONS)
            return
        tasks = self._context.tasks
        routing = tasks.part(InputRouting)
        action = routing.topic("motions")
        what = {"motion": order.motion, "topic": action}
        number = self._records.request(requester.holder, wire.MOTION.record, what, now_s)
        motion = MotionGoal(order.motion, tasks.capabilities.title_of(order.motion, action))
        self._current = goal = Goal(requester, number, now_s, motion, action)

        def swept(space: tuple[Disc, ...] | None, now_s: float) -> None:
            self._take_space(goal, space, now_s, routing.refuse("motions", action))
            self._watch(now_s)

        player.sweep(order.motion, action, swept)

    def _why_not(self, requester: Requester, action: str | None, now_s: float) -> Refusal | None:
        """Return the first rule that forbids a motion. Other motions and the arm's space are checked elsewhere."""
        rules, tasks = self._context.rules, self._context.tasks
        return (
            rules.why_not_begin(requester, now_s)
            or tasks.part(InputRouting).refuse("motions", action)
            or tasks.blocks(Activity.MOVE_ARM, now_s, but=self)
            or rules.why_not_still(now_s)
        )

    def blocks(self, activity: Activity, now_s: float) -> Refusal | None:
        """Return a refusal while a motion runs, also one of another program."""
        refusal = self.refuse(now_s)
        if refusal is not None and activity in _REASONS:
            return _REASONS[activity]
        return refusal

    def refuse(self, now_s: float) -> Refusal | None:
        """Return why the base must stand and no other motion may begin: a motion runs."""
        goal = self._current
        if goal is not None:
            who = goal.requester.holder.holder
            title = goal.what.title
            text = (
                say("The robot performs “{title}”, requested by {who}.", title=title, who=who)
                if self.begun
                else say("The robot is about to perform “{title}”, requested by {who}.", title=title, who=who)
            )
            return Refusal("motion_running", text, "robot", {"motion": goal.what.name, "who": who})
        if busy := self._busy(now_s):
            is_ours = not busy.isdisjoint(self._unwatched_actions)
            text = (
                say("The robot performs a motion that this console no longer watches: it is being cancelled.")
                if is_ours
                else say("The robot performs a motion that another program requested.")
            )
            return Refusal("motion_running", text, "robot")
        return None

    def _take_space(
        self, goal: Goal[MotionGoal], space: Sequence[Disc] | None, now_s: float, why: Refusal | None
    ) -> None:
        """Take the space that the arm sweeps by the motion's present points.

        None: there is no such motion, perhaps because of `why`.
        """
        if goal is not self._current:
            return
        goal.what.space = space
        if space is None:
            name = goal.what.name
            text = say("The robot has no motion “{name}”.", name=name)
            self.deny(why or Refusal("unknown_motion", text, "robot", {"motion": name}), now_s)

    @property
    def _due(self) -> bool:
        """Return whether the motion can be started or refused.

        Its recording has finished (also with an error), and its points are known or not needed.
        """
        goal = self._current
        if goal is None or goal.id is not None or not goal.number.done():
            return False
        known = goal.what.space is not None
        return known or goal.cancelled is not None or goal.number.exception() is not None

    @property
    def _space(self) -> Sequence[Disc]:
        """The space that the arm of this console's motion sweeps; empty after a cancel."""
        goal = self._current
        return goal.what.space or () if goal is not None and goal.cancelled is None else ()

    @property
    def under_way(self) -> list[str]:
        return (
            [say("the motion “{title}”", title=self._current.what.title)] if self._current is not None else []
        )

    def _watch(self, now_s: float) -> None:
        """Start the motion that is due, if no rule forbids it; cancel a motion that must not continue."""
        if self._due:
            if requester := self.waiting:
                refusal = self._why_not(requester, self.topic, now_s)
                refusal = refusal or self._clearance.refuse(self._space, now_s)
                if refusal is not None:
                    self.deny(refusal, now_s)
            goal, player = self._once_recorded(now_s), self._context.robot.part(MotionPlayer)
            if goal is not None and player is not None:
                player.play(goal.sent(now_s), goal.what.name, goal.topic)
        elif self.begun and (refusal := self._clearance.refuse(self._space, now_s, running=True)):
            self.cancel(_OUTCOMES[refusal.code], refusal.sentence)

    def tick(self, now_s: float) -> None:
        """Start or check the motion. Give up a goal, or a request for points, that the robot does not answer."""
        self._watch(now_s)
        goal = self._current
        if goal is not None and goal.what.space is None and now_s - goal.since_s >= PATIENCE_S:
            text = say("The robot took too long to send the motion’s points: ask again.")
            self.deny(Refusal("robot_silent", text, "robot", {"limit_s": PATIENCE_S}), now_s)
        for goal_id, left in list(self._unwatched_goals.items()):
            if left.record.done() and now_s - left.heard_s > UNHEARD_S:
                self._record_unwatched_end(goal_id, left.outcome, now_s)
        super().tick(now_s)

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        if goal_id in self._unwatched_goals:
            self._unwatched_goals[goal_id].outcome = outcome
        super().ended(goal_id, outcome, text, now_s)

    def running(self, action: str, goal_ids: Collection[str], now_s: float) -> None:
        """Take the robot's report of active goals."""
        self._find_own(action, goal_ids, now_s)
        self._cancel_unwatched(action, goal_ids, now_s)

    def leave(self, ending: Ending, now_s: float) -> None:
        """Cancel the motion: the bridge ends, and nobody else watches the arm."""
        self.cancel("control_ended", say("The bridge ended."))
        self._end("cancelled", "", now_s)
        for goal_id in list(self._unwatched_goals):
            self._record_unwatched_end(goal_id, ending.refusal.code, now_s)

    def state(self, now_s: float) -> dict[str, Any]:
        return {"motion": self.view(now_s), "motion_ended": self.last}

    def headline(self, now_s: float) -> tuple[object, ...]:
        return (self._current and self._current.what.name, self.last)

    def view(self, now_s: float) -> wire.Motion | None:
        """Return the motion in progress, for pages."""
        goal = self._current
        if goal is None:
            return None
        return wire.Motion(goal.what.name, goal.requester.holder.holder, round(now_s - goal.since_s, 1))

    def _cancel_unwatched(self, action: str, goal_ids: Collection[str], now_s: float) -> None:
        """Cancel goals of a killed bridge, and goals that this bridge gave up: nobody watches the arm."""
        known = {self._current.id if self._current else None, self._ended}
        strays = [goal_id for goal_id in goal_ids if goal_id.startswith(OURS) and goal_id not in known]
        for goal_id in strays:
            if goal_id in self._unwatched_goals:
                self._unwatched_goals[goal_id].heard_s = now_s
            elif len(self._unwatched_goals) < MOST_LEFT:
                what = {"topic": action, "goal": goal_id}
                record = self._records.own("motion.cancel", what, now_s)
                self._unwatched_goals[goal_id] = _UnwatchedGoal(record, now_s)
        if not strays:
            self._unwatched_actions.pop(action, None)
        elif now_s - self._unwatched_actions.get(action, -math.inf) >= CANCEL_AGAIN_S:
            self._unwatched_actions[action] = now_s
            for goal_id in strays:
                self._send_cancel(goal_id, action)

    def _record_unwatched_end(self, goal_id: str, outcome: str, now_s: float) -> None:
        """Record the result of this cancel."""
        record = self._unwatched_goals.pop(goal_id).record
        self._records.own_outcome(record, "motion.cancel", outcome, {}, now_s)

    def _report_end(self, goal: Goal[MotionGoal], outcome: str, text: str) -> None:
        self.last = wire.MotionEnd(goal.number.result(), goal.what.name, outcome, text)

    def _record(self, goal: Goal[MotionGoal], outcome: str, text: str, now_s: float) -> None:
        duration_s = round(now_s - goal.since_s, 2)
        figures: Parameters = {"motion": goal.what.name, "duration_s": duration_s, "text": text}
        self._records.outcome(goal, wire.MOTION.outcome, outcome, figures, now_s)
