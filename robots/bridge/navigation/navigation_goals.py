"""Drive to a place: one goal of the robot's own navigation at a time, from its record to its end.

While a goal runs, navigation drives the base by a topic of lower priority, and the bridge sends nothing on
its own topic. When the goal ends for any reason, the bridge sends zeros again until navigation is quiet
(`Hold`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

from robots.bridge.audit.records import Requester
from robots.bridge.gate import navigation_watch
from robots.bridge.gate.arm.discs import KNOWN_S
from robots.bridge.navigation.hold import Hold
from robots.bridge.navigation.localisation import Localisation
from robots.bridge.navigation.path import PlannedPath
from robots.bridge.navigation.sensor_grace import MAY_PASS, SensorGrace
from robots.bridge.tasks.goals import OURS, Goal, Goals
from robots.bridge.tasks.input_routing import InputRouting
from robots.bridge.tasks.task import Activity, Cause, Context, Ending, Reaction, TaskPart
from robots.bridge.watchdog.rules import CANCEL_AGAIN_S
from robots.shared import wire
from robots.shared.geometry.planar import NO_POINTS
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.maps.goal_map import NO_MAP, UNKNOWN_NOW, GoalMap
from robots.shared.records.verdict import Verdict
from robots.shared.sentences import Sentence, joined, say, standing_alone
from robots.shared.wire import Go, Grant, Refusal

CONFIRMED_S = 2.0  # the goal ends after this time without a sign of the holder's client
ANSWERS_S = 5.0  # the goal ends after this time without a report from navigation, while the robot stands
LEAST_SPARE_M = 0.03  # least gap to seen obstacles at the start: zeros take effect some centimetres later
SENDS_S = 0.5  # a velocity from navigation is valid for this long; the same timeout as twist_mux
REPORTS_S = 2.0  # a report of running goals is valid for this long
OBEYS_S = 3.0  # after a cancel, navigation has this long to end the goal
STANDS_S = 2.0  # from the end of a drive until the robot stands
LOOKS_S = 4.0  # from the request until the depth camera looks ahead: the head turns, then a picture arrives
# a drive ends after this time without a reading of the map that another node may have replaced
DOUBT_S = 10.0
BEGIN_TIMEOUT_S = 5.0  # after control begins, map and localisation may arrive within this time
MOVES_MPS, MOVES_RADPS = 0.02, 0.05
# Refusals whose cause may end by itself in the first seconds of control.
_MAY_COME = frozenset(
    {"no_map", "map_unknown", "localisation_missing", "localisation_old", "depth_stale", "not_watched"}
)

NO_NAVIGATION = Refusal(
    "no_navigation", "This robot has no navigation of its own that the console knows.", "robot"
)
NO_WATCHDOG = Refusal(
    "watchdog_missing",
    "The robot’s watchdog does not answer: if the bridge failed, nobody would stop the drive. Tell staff.",
    "robot",
)
OTHER_MAP = Refusal(
    "map_changed", "The robot has another map now. Look at the new one, then choose again.", "robot"
)
HEAD_AWAY = Refusal(
    "head_away",
    "The depth camera does not look ahead: the gate would not see table tops. Look ahead first.",
    "gate",
)
CAMERA_AWAY = Refusal(
    "head_away", "The depth camera does not look ahead: the gate would not see table tops.", "gate"
)
# Outcome of the goal, by the code of the halt.
_OUTCOMES = {
    "control_ended": "control_lost",
    "page_gone": "control_lost",
    "page_back": "control_lost",
    "link_lost": "control_lost",
}
# Causes that halt the base: their code says why the goal ended.
_HALTS = {Cause.GATE, Cause.HALTED, Cause.ROBOT_GONE, Cause.CONTROL_ENDED}
# Outcome of the goal, by navigation's result.
_RESULTS = {"succeeded": "arrived", "cancelled": "intruder"}


class Navigator(ABC):
    """The robot's navigation, as this module uses it."""

    @abstractmethod
    def navigates(self) -> bool:
        """Return whether a node of the robot takes goals now."""

    @abstractmethod
    def go(self, goal_id: str, goal: Pose) -> None:
        """Send a goal."""

    @abstractmethod
    def cancel_navigation(self, goal_id: str) -> None:
        """Cancel this goal and no other."""

    @abstractmethod
    def set_pose(self, pose: Pose) -> None:
        """Send the robot its pose on its map."""

    @abstractmethod
    def located(self) -> tuple[float, Pose] | None:
        """Return the stamp of the newest transform from map to odometry, and the transform; None: unknown."""


@dataclass
class Target:
    """A goal, its progress, and the cause of its end."""

    order: Go
    because: str | None = None  # code of the verdict, refusal or halt that ended the goal
    heard_s: float = math.inf  # when navigation last reported on the goal, or the robot last moved
    ending_s: float = math.inf  # when the goal was cancelled
    sensor_grace: SensorGrace = field(default_factory=SensorGrace)
    watch: navigation_watch.Watch = field(default_factory=navigation_watch.Watch)
    digest: str = ""  # of the map on which the goal was checked
    left_m: float | None = None

    @property
    def pose(self) -> Pose:
        return Pose(self.order.x, self.order.y, self.order.heading)


class NavigationGoals(Goals[Target], TaskPart):
    """Goals of the robot's own navigation, one at a time: the drive to a place in progress, if any."""

    kinds = (wire.GO,)
    reactions = {
        Cause.CANCELLED: Reaction.END,
        Cause.SUPERSEDED: Reaction.END,
        Cause.GATE: Reaction.HALT,
        Cause.HALTED: Reaction.HALT,
        Cause.ROBOT_GONE: Reaction.HALT,
        Cause.STOPPED: Reaction.END,
        Cause.CONTROL_ENDED: Reaction.END,
        Cause.PAGE_LEFT: Reaction.DROP,
        Cause.LINK_LOST: Reaction.GO_ON,
        Cause.UNRECORDED: Reaction.END,
        Cause.BRIDGE_ENDED: Reaction.LEAVE,
    }
    outcomes = {Cause.CONTROL_ENDED: "control_lost", Cause.GATE: "held_back"}
    excludes = frozenset({Activity.TURN_HEAD})
    no_task = Refusal("no_goal", "No drive to a place is in progress.", "robot")

    def __init__(self, context: Context) -> None:
        config, gate, records = context.config, context.gate, context.records
        super().__init__(records, lambda goal_id, _topic: self._cancel_on_robot(goal_id))
        self._context = context
        self._source = config.topics.navigation
        self._has_arm = config.gate.has_arm
        self._has_head = config.topics.head is not None
        self._gate = gate
        self.localisation = Localisation()
        self.path = PlannedPath()
        self.hold = Hold(records, self._cancel_on_robot, context.left_goal)
        self._map: GoalMap | None = None
        self._digest = ""  # of the last known map, also while the present one is unknown
        self._doubted_s = math.inf  # since when the robot may have another map
        self.map_run = 0  # grows when the robot may have another map than the last one that was read
        self._map_problem = NO_MAP
        self._at_home_s = -math.inf  # when the arm was last at home
        self._sent, self._sent_s = STILL, -math.inf  # newest velocity of navigation, and its arrival
        self._first_drove_s = math.inf  # when navigation first sent a velocity
        self._ended_s = -math.inf  # when the last drive ended
        self._fence: int | None = None
        self._fence_s = -math.inf  # since when this fence has control
        self._strays: dict[str, float] = {}  # our goals that ended but still run, with their last cancel
        self._reported_s = -math.inf  # when navigation last reported its goals
        self.last: wire.GoEnd | None = None  # how the last goal ended, for pages

    def _cancel_on_robot(self, goal_id: str) -> None:
        if navigator := self._navigator:
            navigator.cancel_navigation(goal_id)

    @property
    def _navigator(self) -> Navigator | None:
        return self._context.robot.part(Navigator)

    # --- requests -------------------------------------------------------------------------------------

    def take(self, order: Go, grant: Grant, requester: Requester, now_s: float) -> None:
        """Record a goal, if no rule forbids it, or if the cause may end by itself in a moment."""
        self.controlled(order.fence, now_s)
        refusal = self.busy() or self._why_not(order, requester, now_s)
        if refusal is not None and not self.may_come(refusal, now_s):
            requester.answer(refusal)
            return
        place: dict[str, str | float | None] = {"x_m": order.x, "y_m": order.y, "heading_rad": order.heading}
        if order.place:
            place["place"] = order.place
        number = self._records.request(requester.holder, wire.GO.record, place, now_s)
        topic = self._source.action if self._source else ""
        self._current = Goal(requester, number, now_s, Target(order), topic)

    def blocks(self, activity: Activity, now_s: float) -> Refusal | None:
        """Return a refusal while a goal is in progress: the head looks where the robot drives."""
        return self.busy() if activity in self.excludes else None

    # --- rules ----------------------------------------------------------------------------------------

    def _why_not(self, order: Go, requester: Requester, now_s: float) -> Refusal | None:
        """Return the first rule that forbids a drive to a place. Other goals are checked elsewhere."""
        rules, tasks = self._context.rules, self._context.tasks
        return (
            rules.why_not_begin(requester, now_s)
            or tasks.blocks(Activity.NAVIGATE, now_s)
            or rules.why_not_still(now_s)
            or (NO_WATCHDOG if rules.watchdog_missing else None)
            or self.refuse_map(order.map)
            or self.refuse(
                Pose(order.x, order.y, order.heading), tasks.part(InputRouting).topic("drive"), now_s
            )
        )

    def refuse(self, goal: Pose, drive_topic: str, now_s: float) -> Refusal | None:
        """Return why the robot cannot be sent to `goal`. Rules of all tasks are checked elsewhere."""
        navigator = self._navigator
        if self._source is None or navigator is None:
            return NO_NAVIGATION
        if self.hold.is_disobeyed:
            return Refusal("navigation_goes_on", self.hold.why, "robot")
        if drive_topic == self._source.velocity:
            text: str = say(
                "The console drives by {topic} itself: choose another topic for driving first.",
                topic=drive_topic,
            )
            return Refusal("no_navigation", text, "robot")
        if self._busy(now_s):
            text = say("The robot’s navigation drives to a place that another program requested.")
            return Refusal("navigation_busy", text, "robot")
        if not navigator.navigates():
            text = say(
                "No node of the robot takes goals on {action}: its navigation does not run.",
                action=self._source.action,
            )
            return Refusal("no_listener", text, "robot", {"topic": self._source.action})
        if self._has_arm and now_s - self._at_home_s > KNOWN_S:
            text = say("The robot’s arm is not at home, or its position is unknown: bring it home first.")
            return Refusal("arm_away", text, "robot")
        if fault := self._gate.fault(now_s):
            text = say("Obstacles around the robot are unknown: {why}.", why=fault.text)
            return Refusal("not_watched", text, "gate", {"sensor": fault.sensor})
        if (lost := navigation_watch.depth_lost(self._gate, now_s)) is not None:
            return Refusal("depth_stale", say("The gate does not see table tops: {why}.", why=lost), "gate")
        if (spare_m := navigation_watch.spare_m(self._gate, now_s)) < LEAST_SPARE_M:
            text = say(
                "Something is within 3 cm of the robot, or may be: drive it away from there by the stick first."
            )
            return Refusal("too_close", text, "gate", {"gap_m": round(spare_m, 3), "limit_m": LEAST_SPARE_M})
        refusal = self.localisation.refuse(now_s) or self._refuse_goal(goal)
        if refusal is not None or self._gate.looks_ahead(now_s):
            return refusal
        # Check this last: the head turns only if no other rule forbids the drive.
        return HEAD_AWAY if self._has_head else CAMERA_AWAY

    def _refuse_goal(self, goal: Pose) -> Refusal | None:
        return self._map_problem if self._map is None else self._map.refuse(goal, self._gate.footprint)

    def refuse_map(self, chosen: str) -> Refusal | None:
        """Return a refusal if a place was chosen on another map than the robot has now, or may have."""
        if self._map is None:
            return self._map_problem if chosen or self._map_problem is UNKNOWN_NOW else None
        return OTHER_MAP if chosen and self._map.digest != chosen else None

    def busy(self) -> Refusal | None:
        """Return a refusal while a goal is in progress or being cancelled."""
        if self._current is None:
            return None
        who = self._current.requester.holder.holder
        text = say("The robot drives to a place, requested by {who}: cancel it or wait.", who=who)
        return Refusal("going", text, "robot", {"who": who})

    def may_come(self, refusal: Refusal, now_s: float) -> bool:
        """Return whether the cause of this refusal may end by itself within seconds.

        This is possible after control has begun, after a drive has ended, and while the head turns.
        """
        if refusal.code == "base_moving":
            return now_s - self._ended_s < STANDS_S
        if refusal is HEAD_AWAY:  # the head turns before the goal is sent
            return self._current is None or now_s - self._current.since_s < LOOKS_S
        return refusal.code in _MAY_COME and now_s - self._fence_s < BEGIN_TIMEOUT_S

    # --- a goal ---------------------------------------------------------------------------------------

    @property
    def due(self) -> Go | None:
        """The goal that is recorded (or whose record failed) but not sent yet."""
        goal = self._current
        return goal.what.order if goal is not None and goal.id is None and goal.number.done() else None

    def _start_due(self, now_s: float) -> None:
        """Send the goal that is due, if no rule forbids it. Refuse it if its record failed."""
        order, requester = self.due, self.waiting
        if order is None:
            return
        if requester is not None and self._current is not None and self._current.number.exception() is None:
            refusal = self._why_not(order, requester, now_s)
            if refusal is not None and self.may_come(refusal, now_s):
                return
            if refusal is not None:
                self.deny(refusal, now_s)
        goal, navigator = self._once_recorded(now_s), self._navigator
        if goal is None or navigator is None:
            return
        goal.what.heard_s = now_s
        goal.what.digest = self._map.digest if self._map else ""
        self.path.take(NO_POINTS)
        self.hold.drop()
        navigator.go(goal.sent(now_s), goal.what.pose)

    @property
    def driving_requester(self) -> Requester | None:
        """The requester of the goal to which navigation drives the robot now; None: it must not drive."""
        goal = self._current
        sent = goal is not None and goal.id is not None and goal.cancelled is None
        return goal.requester if goal is not None and sent else None

    @property
    def may_drive_to(self) -> str:
        """The goal to which navigation drives, or may still drive after its end; empty: none."""
        goal = self._current
        return (goal.id if goal is not None else None) or self.hold.watched

    @property
    def _ending(self) -> bool:
        """Return whether the goal is cancelled, and navigation has not confirmed it."""
        return self._current is not None and self._current.cancelled is not None

    @property
    def under_way(self) -> list[str]:
        return [say("the drive to a place")] if self._current is not None else []

    def end(self, outcome: str, text: str, now_s: float, because: str | None = None) -> None:
        """Cancel the goal, or refuse it if it is not sent. The bridge holds the base from now on."""
        goal = self._current
        if goal is None:
            return
        if goal.cancelled is None:
            goal.what.because = because
        if goal.id is None:
            self.deny(Refusal(outcome, text, "robot"), now_s)
        elif goal.cancelled is None:
            goal.what.ending_s = now_s
            self.cancel(outcome, text)
            self.hold.begin(goal.id, now_s)

    def end_running(self, ending: Ending, now_s: float) -> None:
        if self.begun:
            code = ending.refusal.code
            outcome = _OUTCOMES.get(code) or self._worded(ending).code
            because = code if ending.cause in _HALTS else None
            self.end(outcome, standing_alone(ending.refusal.sentence), now_s, because)

    def judge(self, now_s: float) -> Verdict:
        """Return the gate's verdict on how navigation drives the robot; "free": navigation may continue."""
        watch = self._current.what.watch if self._current else navigation_watch.Watch()
        return watch.judge(self._gate, self.commanded(now_s), now_s)

    @property
    def holds_for_sensor(self) -> bool:
        """Return whether the bridge holds the base because a sensor is silent; navigation keeps its goal."""
        goal = self._current
        return goal is not None and self.driving_requester is not None and goal.what.sensor_grace.holds

    def hold_for_sensor(self, verdict: Verdict, now_s: float) -> bool:
        """Return whether to hold the base and keep the goal.

        True for a short time while a sensor is silent, because this may end by itself. During the hold, other
        verdicts wait too (except those about odometry): late data makes them wrong.
        """
        goal = self._current
        late = verdict.code in MAY_PASS or (self.holds_for_sensor and verdict.sensor != "odometry")
        return goal is not None and late and goal.what.sensor_grace.note_fault(now_s)

    def note_no_fault(self, now_s: float) -> None:
        """Note that no sensor is silent. Navigation drives on when the bridge's last zeros have timed out."""
        if self._current is not None:
            self._current.what.sensor_grace.note_no_fault(now_s)

    def end_if_unconfirmed(self, confirmed_s: float, now_s: float) -> None:
        """End the goal if its holder's client has been silent for `CONFIRMED_S`."""
        if now_s - confirmed_s > CONFIRMED_S:
            text = say(
                "Nothing came from the holder’s page or program for {seconds:.0f} s.", seconds=CONFIRMED_S
            )
            self.end("control_lost", text, now_s, "dead_man")

    # --- events ---------------------------------------------------------------------------------------

    def tick(self, now_s: float) -> None:
        """Watch the goal in progress, then send a goal that is due."""
        grant = self._context.rules.lease.current
        if self._source is not None:
            self._watch(grant.fence if grant else None, now_s)
        self._start_due(now_s)

    def _watch(self, fence: int | None, now_s: float) -> None:
        """Check localisation; give up a goal without reports; hold the base until navigation is quiet."""
        self.controlled(fence, now_s)
        navigator = self._navigator
        located = navigator.located() if navigator else None
        if located is not None and self.localisation.transformed(*located, now_s) and self.driving_requester:
            text = say("The robot’s place on its map jumped by {gap:.1f} m.", gap=self.localisation.jumped_m)
            self.end("location_jumped", text, now_s)
        if self.driving_requester and (refusal := self.localisation.refuse(now_s)):
            self.end("location_lost", refusal.sentence, now_s, refusal.code)
        if self.driving_requester and now_s - self._doubted_s > DOUBT_S:
            key = "Another node publishes the robot’s map, and no map could be read for {seconds:.0f} s."
            text = say(key, seconds=DOUBT_S)
            self.end("map_gone", text, now_s)
        goal = self._current
        if goal is not None and self.driving_requester and now_s - goal.what.heard_s > ANSWERS_S:
            text = say(
                "Navigation reported nothing for {seconds:.0f} s, and the robot stood still.",
                seconds=ANSWERS_S,
            )
            self.end("unheard", text, now_s)
        super().tick(now_s)
        if goal is not None and goal.cancel_sent_s is not None and now_s - goal.what.ending_s > OBEYS_S:
            self._end("cancelled", "", now_s)  # the hold goes on
        if (
            self.driving_requester
            and not self.holds_for_sensor
            and self._has_arm
            and now_s - self._at_home_s > KNOWN_S
        ):
            self.end("arm_away", say("The position of the robot’s arm is unknown now."), now_s)
        runs_on = self.hold.goal_id in self._strays and now_s - self._reported_s < REPORTS_S
        still = self._gate.standstill(now_s)
        self.hold.tick(still, bool(self._busy(now_s)) and fence is None, runs_on or self._ending, now_s)

    def controlled(self, fence: int | None, now_s: float) -> None:
        """Note the fence that has control now."""
        if fence != self._fence:
            self._fence, self._fence_s = fence, now_s

    def commanded(self, now_s: float) -> Velocity | None:
        """Return the velocity that navigation sends to the base now; None: none."""
        return self._sent if now_s - self._sent_s < SENDS_S else None

    def moved(self, pose: Pose, velocity: Velocity, now_s: float) -> None:
        """Take odometry."""
        self.localisation.moved(pose)
        goal = self._current
        if goal is None or goal.id is None:
            return
        if math.hypot(velocity.vx, velocity.vy) > MOVES_MPS or abs(velocity.w) > MOVES_RADPS:
            goal.what.heard_s = now_s
        if (here := self.localisation.pose) is not None:
            goal.what.left_m = round(self.path.left_m(here, goal.what.pose), 2)

    def arm(self, at_home: bool, now_s: float) -> None:
        """Note whether the arm is at home. If it is not, end the drive."""
        if at_home:
            self._at_home_s = now_s
        elif self.driving_requester:
            self.end("arm_away", say("The robot’s arm left its home."), now_s)

    def mapped(self, goal_map: GoalMap, now_s: float) -> None:
        """Take the robot's map. If it is another map, end the drive: a pose on the map before is none on this one."""
        if self._digest not in ("", goal_map.digest):
            self.localisation.forget()
            self.path.take(NO_POINTS)
        self._map, self._digest, self._doubted_s = goal_map, goal_map.digest, math.inf
        goal = self._current
        if goal is not None and self.driving_requester and goal.what.digest != goal_map.digest:
            self.end("map_changed", say("The robot’s map changed."), now_s)

    def map_doubted(self, now_s: float, *, restarted: bool) -> None:
        """Note that the robot may have another map now: no new goal until it is read.

        `restarted`: the robot may be anywhere on it, too, so a drive ends. Else another map server publishes the
        map: a drive ends only if the map that is then read is another one, or if none is read for `DOUBT_S`.
        """
        self.map_run += 1
        self._doubted_s = min(self._doubted_s, now_s)
        self._map, self._map_problem = None, UNKNOWN_NOW
        if restarted:
            self.localisation.forget()
            self.path.take(NO_POINTS)
            self.end("map_changed", say("The robot’s map may be another one now."), now_s)

    def unmapped(self, why: Sentence, now_s: float) -> None:
        """Note that the robot has no usable map now. End the drive."""
        text = say("The robot has no map that can be used: {why}", why=why)
        self._map, self._map_problem = None, Refusal("no_map", standing_alone(text), "robot")
        self._doubted_s = math.inf
        self.end("map_gone", self._map_problem.sentence, now_s)

    def drove(self, velocity: Velocity, now_s: float) -> None:
        """Take a velocity that navigation sends to the base."""
        self._sent, self._sent_s = velocity, now_s
        self._first_drove_s = min(self._first_drove_s, now_s)
        # After its start, the bridge does not know the goals of others yet. Navigation soon reports them.
        is_known = self._reported_s > -math.inf or now_s - self._first_drove_s > REPORTS_S
        has_goal = self.driving_requester is not None or bool(self._busy(now_s)) or not is_known
        self.hold.drove(any(abs(part) > 1e-3 for part in velocity), has_goal, now_s)

    def running(self, action: str, goal_ids: Collection[str], now_s: float) -> None:
        """Take navigation's report of active goals. Cancel goals of a bridge that was killed."""
        self._reported_s = now_s
        current = self._current.id if self._current else None
        strays = {goal_id for goal_id in goal_ids if goal_id.startswith(OURS) and goal_id != current}
        self._find_own(action, [goal_id for goal_id in goal_ids if goal_id not in strays], now_s)
        for goal_id in strays - self._strays.keys() - {self._ended}:
            self.hold.begin(goal_id, now_s)
        self._strays = {goal_id: self._strays.get(goal_id, -math.inf) for goal_id in strays}
        for goal_id, cancelled_s in self._strays.items():
            if now_s - cancelled_s >= CANCEL_AGAIN_S:
                self._strays[goal_id] = now_s
                self._cancel_on_robot(goal_id)

    def answered(self, goal_id: str, now_s: float) -> None:
        """Take feedback on a goal."""
        if self._current is not None and self._current.id == goal_id:
            self._current.what.heard_s = now_s

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        goal = self._current
        if goal is not None and goal.id == goal_id:
            if goal.cancelled is None:
                self._end(_RESULTS.get(outcome, outcome), _result(outcome, text), now_s)
            else:  # the reason of the cancel stays
                self._end("arrived" if outcome == "succeeded" else "cancelled", "", now_s)
        elif self.driving_requester and goal_id != self._ended and not self._busy(now_s):
            self.end("answered_another", say("Navigation reported a result for an unknown goal."), now_s)

    @property
    def shown_path(self) -> wire.GoPath:
        """The path of the goal in progress, for pages."""
        return wire.GoPath(self.path.centimetres if self.driving_requester else [])

    # --- for pages and records --------------------------------------------------------------------------

    def state(self, now_s: float) -> dict[str, Any]:
        return {
            "location": self.location(now_s, self._context.rules.lease.current is not None),
            "going": self.view(now_s),
            "going_ended": self.last,
            "navigation_held": self.hold.why,
        }

    def headline(self, now_s: float) -> tuple[object, ...]:
        goal = self.view(now_s)
        return (goal and (goal.number, goal.ending), self.last, self.hold.why)

    def view(self, now_s: float) -> wire.GoProgress | None:
        """Return the goal in progress."""
        goal = self._current
        if goal is None:
            return None
        order = goal.what.order
        return wire.GoProgress(
            number=_number(goal),
            who=goal.requester.holder.holder,
            x=order.x,
            y=order.y,
            heading=order.heading,
            left_m=goal.what.left_m,
            since_s=round(now_s - goal.since_s, 1),
            ending=goal.cancelled.sentence if goal.cancelled else "",
            place=order.place,
        )

    def location(self, now_s: float, in_control: bool) -> wire.Location | None:
        """Return the robot's pose on its map. Without control, `problem` is empty: then tf is not read."""
        problem = self.localisation.refuse(now_s) if in_control else None
        return self.localisation.view(now_s, problem.sentence if problem else "")

    def _report_end(self, goal: Goal[Target], outcome: str, text: str) -> None:
        self.last = wire.GoEnd(
            number=_number(goal),
            seq=goal.what.order.seq,
            fence=goal.what.order.fence,
            outcome=outcome,
            text=text,
            because=goal.what.because,
            left_m=goal.what.left_m,
        )

    def _record(self, goal: Goal[Target], outcome: str, text: str, now_s: float) -> None:
        if goal.id is not None:
            self._ended_s = now_s
            self.hold.begin(goal.id, now_s)
        figures: dict[str, str | float | None] = {
            "duration_s": round(now_s - goal.since_s, 2),
            "left_m": goal.what.left_m,
            "because": goal.what.because,
            "text": text,
        }
        told = {name: value for name, value in figures.items() if value is not None and value != ""}
        self._records.outcome(goal, wire.GO.outcome, outcome, told, now_s)


def _number(goal: Goal[Target]) -> int | None:
    return goal.number.result() if goal.number.done() and goal.number.exception() is None else None


def _result(outcome: str, text: str) -> str:
    """Return navigation's text about its result as a sentence."""
    if outcome == "succeeded":
        return ""
    said = say("Navigation said: {text}", text=text) if text else say("Navigation did not say why.")
    return joined(" ", [say("Another program cancelled it."), said]) if outcome == "cancelled" else said
