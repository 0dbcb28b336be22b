"""One limb's move: request, record, goal, checks by joint states, end, record of the end."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

from robots.bridge.audit.records import Records, Requester
from robots.bridge.gate.words import LIMBS
from robots.bridge.tasks.goals import OURS, UNHEARD_S, Goal, Goals
from robots.bridge.tasks.task import Cause, Ending, Robot
from robots.bridge.watchdog.rules import CANCEL_AGAIN_S
from robots.shared import wire
from robots.shared.configuration.bridge_config import LimbSource
from robots.shared.records.record_sink import Parameters
from robots.shared.sentences import Sentence, say
from robots.shared.wire import Limb, MoveLimb, Refusal

TOP_TO_MEAN_SPEED = 1.5  # top speed / mean speed of a controller that begins and ends at rest
LEAST_S = 0.5  # shortest duration of a move
MOVED_M = 0.001  # smaller changes are noise of joint states
STILL_S = 3.0  # a limb that has not moved by `MOVED_M` for this time has stopped on its way
SILENT_S = 1.0  # joint states that are missing for longer end the move
THERE_M = 0.01  # a limb within this distance of its goal has arrived
SETTLED_S = 1.0  # after an unreported end of a goal: a limb without motion for this time stands
LOST_S = 5.0  # after this time without joint states, it is unknown whether the limb stands
OBEYS_S = 5.0  # a cancelled goal that the controller still reports is given up after this, if the limb stands


class LimbMover(ABC):
    """The robot's limbs."""

    @abstractmethod
    def limb_at(self, limb: Limb) -> float | None:
        """Return a limb's position by joint states (metres); None: unknown."""

    @abstractmethod
    def limb_has_listener(self, limb: Limb) -> bool:
        """Return whether a node of the robot takes goals for this limb."""

    @abstractmethod
    def move_limb(self, limb: Limb, goal_id: str, to_m: float, seconds: float) -> None:
        """Send a goal."""

    @abstractmethod
    def cancel_limb(self, limb: Limb, goal_id: str) -> None:
        """Cancel this goal and no other."""


@dataclass
class Target:
    """A limb's target, and its motion as observed so far."""

    order: MoveLimb
    seconds: float = LEAST_S
    active: bool = False  # the controller has begun the goal
    known_s: float = math.inf  # when the limb's position was last known
    moved_s: float = math.inf  # when the limb last moved
    ending_s: float = math.inf  # when the goal was cancelled
    moved_m: float | None = None  # the limb's position at `moved_s`


class LimbMove(Goals[Target]):
    """The move of one limb in progress, if any."""

    def __init__(self, limb: Limb, source: LimbSource, robot: Robot, records: Records) -> None:
        super().__init__(records, lambda goal_id, _: self._cancel_on_robot(goal_id))
        self._limb = limb
        self._source = source
        self._robot = robot
        self._range = [len(source.joints) * end for end in source.range_m]
        # A goal that has ended for the bridge but still runs in the controller: the fingers hold something.
        self._held: str | None = None
        # A goal of an earlier bridge may still hold something. False after this bridge has sent a goal.
        self._may_hold = limb == "gripper"
        self._stands: tuple[float, float] | None = None  # since when and where fingers with such a goal stand
        self._found_s = math.inf  # when such a goal was first reported without a known position
        self._strays: dict[str, float] = {}  # goals that nobody watches, with the time of their last cancel
        self._strays_s = -math.inf  # when the controller last reported its goals
        # A target whose end the controller did not report: the limb may still move.
        self._settling: Target | None = None
        self._known_s = math.inf  # when the position was last known, but not before the first tick
        self._lost = False  # joint states have been missing for `LOST_S`
        self.last: wire.LimbEnd | None = None

    @property
    def at_m(self) -> float | None:
        """The limb's position by joint states (m); None: unknown."""
        mover = self._robot.part(LimbMover)
        return mover.limb_at(self._limb) if mover else None

    def _cancel_on_robot(self, goal_id: str) -> None:
        if mover := self._robot.part(LimbMover):
            mover.cancel_limb(self._limb, goal_id)

    @property
    def may_move(self) -> bool:
        """Return whether the limb may move although no move is in progress."""
        return self._settling is not None or bool(self._strays)

    @property
    def is_lost(self) -> bool:
        """Return whether the limb may move and its joint states have ended. They may never come back."""
        return self._lost and self.may_move

    @property
    def under_way(self) -> list[str]:
        """The move, in words."""
        return [say("the move of the {limb}", limb=LIMBS[self._limb])] if self.in_progress else []

    def refuse(self, to_m: float, now_s: float) -> Refusal | None:
        """Return why this limb cannot move to `to_m` now."""
        limb, (low, high) = self._limb, self._range
        if not low - 1e-6 <= to_m <= high + 1e-6:  # also true for NaN
            text = say(
                "The {limb} goes from {low} to {high} m.", limb=LIMBS[limb], low=f"{low:g}", high=f"{high:g}"
            )
            return Refusal("out_of_range", text, "robot", {"least_m": low, "most_m": high})
        mover = self._robot.part(LimbMover)
        if mover is None or not mover.limb_has_listener(limb):
            text = say(
                "No node on the robot takes goals for its {limb} ({action}).",
                limb=LIMBS[limb],
                action=self._source.action,
            )
            return Refusal("no_listener", text, "robot", {"topic": self._source.action})
        if self.at_m is None:
            text = say(
                "The position of the {limb} is unknown: its joint states are missing.", limb=LIMBS[limb]
            )
            return Refusal("limb_unknown", text, "robot")
        if self._busy(now_s):
            return Refusal(
                "limb_busy", say("Something else on the robot moves the {limb}.", limb=LIMBS[limb]), "robot"
            )
        return None

    def begin(self, order: MoveLimb, requester: Requester, now_s: float) -> None:
        """End a move in progress and record the new request. `start` sends it when it is recorded."""
        replaced = Refusal("replaced", "A new request replaced it.", "robot")
        self.deny(replaced, now_s)
        self.leave(Ending(Cause.SUPERSEDED, replaced), now_s)
        what = {"limb": self._limb, "to_m": round(order.to_m, 4)}
        number = self._records.request(requester.holder, wire.LIMB.record, what, now_s)
        self._current = Goal(requester, number, now_s, Target(order), self._limb)

    @property
    def due(self) -> Requester | None:
        """The requester of a move whose recording has finished (also with an error) and that is not sent."""
        goal = self._current
        return self.waiting if goal is not None and goal.number.done() else None

    @property
    def to_m(self) -> float | None:
        """The goal of the move in progress (m); None: no move is in progress."""
        return self._current.what.order.to_m if self._current else None

    def start(self, now_s: float) -> None:
        """Send the goal whose record is written. Drop it if its record failed or if it was cancelled."""
        goal, at_m, mover = self._once_recorded(now_s), self.at_m, self._robot.part(LimbMover)
        if goal is None or mover is None:
            return
        target = goal.what
        way_m = abs(target.order.to_m - (self._range[0] if at_m is None else at_m)) / len(self._source.joints)
        target.seconds = max(LEAST_S, TOP_TO_MEAN_SPEED * way_m / self._source.speed_mps)
        target.known_s = target.moved_s = now_s
        target.moved_m = at_m
        low, high = self._range
        to_m = min(max(target.order.to_m, low), high)
        self._may_hold = False
        mover.move_limb(self._limb, goal.sent(now_s), to_m, target.seconds)

    def tick(self, now_s: float) -> None:
        """Check the move by joint states; give up a goal that the controller does not answer."""
        self._known_s = min(self._known_s, now_s) if self.at_m is None else now_s
        self._lost = now_s - self._known_s > LOST_S
        goal = self._current
        if goal is not None and goal.id is not None and goal.cancelled is None:
            self._watch(goal.id, goal.what, now_s)
        goal = self._current
        super().tick(now_s)
        if goal is not None and goal.id is not None and goal is self._current and goal.cancelled is not None:
            self._give_up(goal.what, now_s)
        elif goal is not None and goal.id is not None and self._current is None:  # not reported
            self._doubt(goal.what, now_s)
        self._settle(now_s)

    def _doubt(self, target: Target, now_s: float) -> None:
        target.moved_s = now_s
        self._settling = target

    def _settle(self, now_s: float) -> None:
        if now_s - self._strays_s > UNHEARD_S:
            self._strays = {}
        if (target := self._settling) is None:
            return
        self._follow(target, now_s)
        if target.known_s - target.moved_s >= SETTLED_S:  # observed at standstill this long
            self._settling = None

    def _give_up(self, target: Target, now_s: float) -> None:
        """End a cancelled move whose end the controller does not report, when the limb stands or is lost.

        `running` continues to cancel its goal.
        """
        target.ending_s = min(target.ending_s, now_s)
        self._follow(target, now_s)
        if target.known_s - max(target.ending_s, target.moved_s) > OBEYS_S:
            self._end("cancelled", "", now_s)
        elif self._lost and now_s - target.ending_s > OBEYS_S:
            self._doubt(target, now_s)
            self._end("cancelled", "", now_s)

    def _follow(self, target: Target, now_s: float) -> None:
        at_m = self.at_m
        if at_m is None:
            return
        target.known_s = now_s
        if target.moved_m is None or abs(at_m - target.moved_m) >= MOVED_M:
            target.moved_m, target.moved_s = at_m, now_s

    def _watch(self, goal_id: str, target: Target, now_s: float) -> None:
        at_m = self.at_m
        if at_m is None:
            if now_s - target.known_s > SILENT_S:
                key = "The position of the {limb} is unknown now: its joint states ended."
                self.cancel("not_watched", say(key, limb=LIMBS[self._limb]))
            return
        self._follow(target, now_s)
        if now_s - target.moved_s <= STILL_S or abs(at_m - target.order.to_m) <= THERE_M:
            return
        if self._limb == "gripper" and target.order.to_m < at_m and target.active:
            # Do not cancel: then the controller keeps its present position, and the fingers drop the object.
            self._held = goal_id
            self._end("stalled", self._stuck(at_m), now_s)
        else:
            self.cancel("no_progress", self._stuck(at_m))

    def _stuck(self, at_m: float) -> Sentence:
        text = say("The {limb} stopped at {position:.3f} m.", limb=LIMBS[self._limb], position=at_m)
        return say("{stuck} Perhaps it holds something.", stuck=text) if self._limb == "gripper" else text

    def running(self, goals: Mapping[str, bool], now_s: float) -> None:
        """Take the controller's report: its goals, and whether each is active (begun and not cancelled).

        Cancel goals that nobody watches.
        """
        self._strays_s = now_s
        current = self._current.id if self._current else None
        holds = self._held is not None and self._held == self._ended and goals.get(self._held)
        watched = {current, self._held if holds else None}
        strays = {goal_id for goal_id in goals if goal_id.startswith(OURS) and goal_id not in watched}
        own = self._find_own(self._limb, [goal_id for goal_id in goals if goal_id not in strays], now_s)
        if own is not None and own.id is not None:
            own.what.active = goals[own.id]
        self._strays = {goal_id: self._strays.get(goal_id, -math.inf) for goal_id in strays}
        for goal_id, cancelled_s in self._strays.items():
            if (
                goals[goal_id]
                and math.isinf(cancelled_s)
                and self._may_hold
                and self._keeps_earlier_goal(goal_id, now_s)
            ):
                continue
            self._may_hold = False  # from now on, goals of an earlier bridge are cancelled
            if now_s - cancelled_s >= CANCEL_AGAIN_S:
                self._strays[goal_id] = now_s
                self._cancel_on_robot(goal_id)

    def _keeps_earlier_goal(self, goal_id: str, now_s: float) -> bool:
        """Return whether to keep a goal of an earlier bridge: the fingers stand, or their position may come.

        The fingers may hold something, and a restart of the bridge must not drop it.
        """
        at_m = self.at_m
        if at_m is None:
            self._found_s = min(self._found_s, now_s)
            return now_s - self._found_s <= LOST_S
        since_s, was_m = self._stands = self._stands or (now_s, at_m)
        if abs(at_m - was_m) >= MOVED_M:
            return False
        if now_s - since_s > STILL_S:
            self._held = self._ended = goal_id
            self._may_hold = False
        return True

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        """Take the controller's report that a goal has ended. Success counts only if joint states agree."""
        goal = self._current
        if goal is None or goal.id != goal_id:
            return
        at_m = self.at_m
        there = at_m is not None and abs(at_m - goal.what.order.to_m) <= THERE_M
        if outcome == "stalled" and at_m is not None:
            outcome, text = ("done", "") if there else ("stalled", self._stuck(at_m))
        elif outcome == "succeeded":
            where = say("nothing") if at_m is None else say("{position:.3f} m", position=at_m)
            said = say("The controller reports success, but joint states report {where}.", where=where)
            outcome, text = ("done", "") if there else ("not_there", said)
        elif outcome == "cancelled" and goal.cancelled is None:
            outcome, text = (
                "taken_over",
                say("Something else on the robot took the {limb} over.", limb=LIMBS[self._limb]),
            )
        self._end(outcome, text, now_s)

    def view(self, now_s: float) -> wire.LimbState:
        """Return the limb for pages."""
        at_m, goal = self.at_m, self._current
        at_m = None if at_m is None else round(at_m, 3)
        if goal is None:
            return wire.LimbState(at_m, ended=self.last)
        return wire.LimbState(
            at_m=at_m,
            to_m=goal.what.order.to_m,
            who=goal.requester.holder.holder,
            since_s=round(now_s - goal.since_s, 1),
            ending=goal.cancelled.sentence if goal.cancelled else "",
            ended=self.last,
        )

    def _report_end(self, goal: Goal[Target], outcome: str, text: str) -> None:
        done, order, at_m = goal.number, goal.what.order, self.at_m
        number = done.result() if done.done() and done.exception() is None else None
        at_m = None if at_m is None else round(at_m, 3)
        self.last = wire.LimbEnd(number, order.seq, order.fence, outcome, text, at_m)

    def _record(self, goal: Goal[Target], outcome: str, text: str, now_s: float) -> None:
        at_m = self.at_m
        figures: Parameters = {"limb": self._limb, "duration_s": round(now_s - goal.since_s, 2)}
        if at_m is not None:
            figures = {**figures, "at_m": round(at_m, 3)}
        if text:
            figures = {**figures, "text": text}
        self._records.outcome(goal, wire.LIMB.outcome, outcome, figures, now_s)
