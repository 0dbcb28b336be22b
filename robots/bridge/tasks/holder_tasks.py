"""Tasks of the holder: looks, motions, limbs, speech, publishing, topics, and drives without a stick.

Each task passes the same checks as a stick position (lease, stop, robot online), is recorded, and only then sent to the
robot. This module never blocks, and an ended task never begins again by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from msgspec import structs

from robots import wire
from robots.bridge.audit.record_sink import Holder, Parameters
from robots.bridge.audit.records import RecordedTask, Records, Reply, Requester, pop_due
from robots.bridge.config import BridgeConfig
from robots.bridge.drive import twists
from robots.bridge.drive.drive_by import DrivesBy
from robots.bridge.drive.input_filters import COMMAND_LIFE_S
from robots.bridge.gate.gate import Gate
from robots.bridge.gate.geometry.arm_discs import Disc
from robots.bridge.gate.values import STILL, Pose, Velocity
from robots.bridge.lease.lease_guard import LeaseGuard
from robots.bridge.limbs.limb_move import LimbMover
from robots.bridge.limbs.limbs import Limbs
from robots.bridge.navigation.navigation_goals import NO_NAVIGATION, NavigationGoals, Navigator
from robots.bridge.tasks import input_routing
from robots.bridge.tasks.arm_clearance import ArmClearance, ArmModel
from robots.bridge.tasks.capabilities import Capabilities
from robots.bridge.tasks.denylist import admissible
from robots.bridge.tasks.head import Aim, Head
from robots.bridge.tasks.input_routing import InputRouting, InputSwitch
from robots.bridge.tasks.motions import MotionPlayer, Motions
from robots.bridge.tasks.named_ends import NamedEnds
from robots.bridge.tasks.publishing import HALTED, Publications, Publisher
from robots.bridge.tasks.speech import SpeechOutput, SpeechTasks, Utterance, robot_language, why_not_speakable
from robots.wire import Grant, Refusal

LINK_PATIENCE_S = 2.0  # a motion continues this long without the page of its requester
TURNS_S = 10.0  # turns of the head with shorter pauses have one record together
MOST_TURNS = 20  # turns of the head that may wait for their record
ENDED = Refusal("bridge_ended", "It was not done: the robot’s bridge ended.", "robot")
LEFT = Refusal("link_lost", "It was not done: the page that asked for it was left.", "lease")
# Outcome of a motion, by the code of the refusal that ends it.
OUTCOMES = {"motion_blocked": "intruder", "not_watched": "not_watched"}

# A callback, called later on the event loop. Arguments: the space that the arm sweeps from its present
# position (None: the action has no such motion), and the time.
Swept = Callable[[tuple[Disc, ...] | None, float], None]


NO_WATCHDOG = Refusal(
    "watchdog_missing",
    "The robot’s watchdog does not answer: if the bridge failed, nobody would stop the drive. Tell staff.",
    "robot",
)


class TaskRules(input_routing.RoutingRules, Protocol):
    """The core, as tasks use it."""

    lease: LeaseGuard
    watchdog_missing: bool  # nobody would stop a robot that drives itself if the bridge failed

    def why_closed(self, now_s: float) -> Refusal | None:
        """Return why the robot takes no request from anybody: stopped, offline, or records cannot be written."""

    def twist(self, velocity: Velocity, order: wire.Publish, grant: Grant, now_s: float) -> Refusal | None:
        """Take a velocity from a program of the holder. It passes the same rules as a stick position."""


class TaskPerformer(MotionPlayer, SpeechOutput, InputSwitch, ArmModel, Navigator, LimbMover, Protocol):
    """The robot, as tasks use it."""

    def aim_head(self, aim: Aim) -> None:
        """Send the head to this aim."""

    def head_at(self) -> tuple[float, float] | None:
        """Return pan and tilt of the head (radians) by its joint states; None if they are unknown."""

    def sweep(self, motion: str, action: str, then: Swept) -> None:
        """Ask the robot for a motion's present points; call `then` with the space that the arm would sweep.

        Returns at once. If the points have changed, the list of motions is read again. If the action had no subscriber
        at the last survey, `InputRouting.surveyed` is called first with the present subscribers.
        """


class HolderTasks:
    """The tasks of one robot's holder."""

    def __init__(
        self,
        config: BridgeConfig,
        performer: TaskPerformer,
        gate: Gate,
        records: Records,
        rules: TaskRules,
        publisher: Publisher,
        announce: Callable[[wire.Offers], None],
        left_goal: str = "",
    ) -> None:
        """`left_goal`: navigation's goal of an earlier bridge; the robot may still drive to it."""
        config = structs.replace(config, allowed=admissible(config.allowed, config.topics))
        self.motions = Motions(performer, records)
        self.speech = SpeechTasks(performer, records)
        self.routing = InputRouting(config, performer, records, rules)
        self.capabilities = Capabilities(config, self.routing, announce)
        self.publications = Publications(publisher, records)
        self.drives_by = DrivesBy(config.gate.limits, gate, records)
        self.navigation = NavigationGoals(config, performer, gate, records, left_goal)
        self.limbs = Limbs(config, performer, records)
        self._config = config
        self._publisher = publisher
        self._performer = performer
        self._clearance = ArmClearance(gate, performer)
        self._named = NamedEnds()
        self._records = records
        self._rules = rules
        self._head = Head(config.topics.head) if config.topics.head else None
        self._gate = gate
        # Requests that are carried out as soon as they are recorded; and the extra rules of each kind.
        self._asked: dict[str, list[RecordedTask]] = {
            "head.look_ahead": [],
            "head.turn": [],
            "memory.forget": [],
            "pose.set": [],
        }
        self._why_not = {
            "head.look_ahead": self._why_no_look,
            "head.turn": self._why_no_look,
            "memory.forget": self._why_not_forget,
            "pose.set": self._why_not_set_pose,
        }
        self._pose: wire.SetPose | None = None  # the pose that waits for its record and the map
        self._turns: list[wire.TurnHead] = []  # turns that wait for their record
        # Fence of the recorded turns, and until when further turns need no new record.
        self._turning: tuple[int, float] = (0, float("-inf"))

    def take(self, order: wire.TaskRequest, link: int, now_s: float, answer: Reply) -> None:
        """Begin a task. `answer` is called once, now or later: with a refusal, or None."""
        refusal = self._rules.lease.refuse_command(order.fence or 0, link, now_s)
        grant = self._rules.lease.current
        if refusal is not None or grant is None:
            answer(refusal)
            return
        requester = Requester(holder_of(grant), link, answer)
        match order:
            case wire.Publish():
                self._publish(order, grant, requester, now_s)
            case wire.Play():
                self._play(order, requester, now_s)
            case wire.DriveBy():
                self._drive_by(order, grant, requester, now_s)
            case wire.Go():
                self._go(order, requester, now_s)
            case wire.SetPose():
                self._set_pose(order, requester, now_s)
            case wire.MoveLimb():
                self.limbs.take(order, requester, self._why_no_limb, now_s)
            case wire.LookAhead():
                self._ask("head.look_ahead", requester, now_s)
            case wire.TurnHead():
                self._turn_head(order, requester, now_s)
            case wire.Forget():
                self._ask("memory.forget", requester, now_s)
            case wire.Say():
                self._say(order, requester, now_s)
            case wire.Choose():
                self.routing.take(order, requester, now_s)
            case _:
                answer(self._cancel_task(order, now_s))

    def _cancel_task(self, order: wire.TaskRequest, now_s: float) -> Refusal | None:
        """End a task at once and record its outcome."""
        match order:
            case wire.PlayCancel():
                return self._cancel_motion("Its holder cancelled it.")
            case wire.SayCancel():
                return self._cancel_speech("Its holder cancelled it.")
            case wire.DriveByCancel():
                return self.drives_by.cancel("Its holder cancelled it.", now_s)
            case wire.GoCancel():
                return self.navigation.withdraw(now_s)
            case wire.LimbCancel(limb=limb):
                return self.limbs.cancel(limb)
            case wire.PublishStop(topic=topic):
                return self.publications.stop(topic, now_s)
            case _:
                return Refusal(
                    "not_offered", "This bridge does not know the request. Reload the page.", "robot"
                )

    def cancel(self, what: str, by: str) -> Refusal | None:
        """Cancel a task for a person who need not have control; the web process has checked the right."""
        why = self._named.words(f"Cancelled by {by}.", "Another person cancelled it.")
        return self._cancel_motion(why) if what == "motion" else self._cancel_speech(why)

    def refresh(self) -> None:
        """Read the robot's capabilities again and report them."""
        if "motions" in self.routing.uses:
            self.capabilities.request_report()
            self._performer.read_motions()
        else:
            self.capabilities.report(anyway=True)

    def why_stand(self, now_s: float, *, crawls: bool = False) -> Refusal | None:
        """Return why the base must stand: a motion runs, or a limb moves. `crawls`: the gate limits its speed."""
        return self.motions.refuse(now_s) or self.limbs.busy(crawls=crawls)

    @property
    def under_way(self) -> list[str]:
        """Tasks in progress, in words. A text being spoken is not included: it ends by itself."""
        return (
            self.drives_by.under_way
            + self.navigation.under_way
            + self.motions.under_way
            + self.limbs.under_way
            + self.publications.under_way
        )

    # --- events -----------------------------------------------------------------------------------

    def tick(self, sent: Velocity, page_gone_s: float | None, now_s: float) -> None:
        """Send recorded tasks to the robot; cancel tasks that must not continue.

        `sent`: the last twist to the base. `page_gone_s`: when the holder's page was lost; None while it is there.
        """
        if page_gone_s is not None and now_s - page_gone_s > LINK_PATIENCE_S:
            why = f"The requester’s page was not connected for {LINK_PATIENCE_S:.0f} s."
            self.motions.cancel("link_lost", why)
            self.limbs.end(Refusal("link_lost", why, "lease"), now_s)
            self.publications.halt("link_lost", now_s)
        self.publications.tick(self._rules.why_not_begin, now_s)
        if requester := self.drives_by.waiting:
            self.drives_by.start(self._why_no_drive(requester, now_s), now_s)
        self._watch_navigation(now_s)
        self._watch_motion(now_s)
        self.limbs.tick(self._why_no_limb, now_s)
        self._gate.observe_lost_limb(self.limbs.lost)
        self._watch_speech(now_s)
        self.routing.tick({"speech": self.speech.topics(now_s)}, now_s)
        self.capabilities.report()
        self._move_head(sent, now_s)
        if self._granted("memory.forget", now_s):
            self._gate.forget()
        self._place(now_s)
        self._named.tick((self.motions, self.speech, self.navigation, *self.limbs.moves), now_s)

    def stopped(self, by: str, now_s: float) -> None:
        """End tasks: stop was pressed."""
        self._deny_asked(now_s)
        self.drives_by.halt("stopped", HALTED, now_s)
        why = self._named.words(f"The robot was stopped by {by}.", "The robot was stopped.")
        self.navigation.end("stopped", why, now_s)
        self.publications.halt("stopped", now_s)
        self.motions.cancel("stopped", why)
        self.limbs.end(Refusal("stopped", why, "stop"), now_s)
        self.speech.cancel("stopped", why)

    def unrecorded(self, refusal: Refusal, now_s: float) -> None:
        """End tasks: records cannot be written. A text being spoken is spoken to its end."""
        self._deny_asked(now_s, refusal)
        self.drives_by.halt(refusal.code, refusal, now_s)
        self.navigation.end(refusal.code, refusal.text, now_s)
        self.publications.halt(refusal.code, now_s, refusal)
        self.motions.halt(refusal, now_s)
        self.limbs.end(refusal, now_s)
        self.speech.deny(refusal, now_s)
        self.routing.withdraw(refusal, now_s)

    def page_left(self, now_s: float) -> None:
        """Drop tasks that have not begun: their page is gone. `tick` handles running tasks."""
        self._deny_asked(now_s, LEFT)
        self.drives_by.deny(LEFT.code, LEFT, now_s)
        self.navigation.deny(LEFT, now_s)
        self.publications.deny(LEFT.code, now_s, LEFT)
        self.motions.deny(LEFT, now_s)
        self.limbs.deny(LEFT, now_s)
        self.speech.deny(LEFT, now_s)
        self.routing.withdraw(LEFT, now_s)

    def control_ended(self, reason: str, now_s: float) -> None:
        """Cancel running tasks: their owner lost control. A text being spoken is spoken to its end."""
        self._deny_asked(now_s)
        self._named.words(reason, "Its holder’s control ended.")
        self.drives_by.halt("control_lost", HALTED, now_s)
        self.navigation.end("control_lost", reason, now_s)
        self.publications.halt("control_ended", now_s)
        self.motions.cancel("control_ended", reason)
        self.limbs.end(Refusal("control_ended", reason, "lease"), now_s)
        if self.speech.waiting:
            self.speech.cancel("cancelled", reason)
        self.routing.control_ended(reason, now_s)

    def close(self, now_s: float) -> None:
        """End all tasks: the bridge ends."""
        self._deny_asked(now_s, ENDED)
        self.drives_by.halt(ENDED.code, ENDED, now_s)
        self.navigation.close(ENDED, now_s)
        self.publications.halt(ENDED.code, now_s, ENDED)
        self.motions.close(ENDED, now_s)
        self.limbs.close(ENDED, now_s)
        self.speech.close(ENDED, now_s)
        self.routing.close(ENDED, now_s)

    # --- requests that are done at once -----------------------------------------------------------

    def _ask(self, kind: str, requester: Requester, now_s: float, parameters: Parameters = {}) -> None:  # noqa: B006
        """Record a request. When it is recorded, `tick` carries it out and answers the requester."""
        refusal = self._rules.why_not_begin(requester, now_s) or self._why_not[kind](now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        number = self._records.request(requester.holder, kind, parameters, now_s)
        self._asked[kind].append(RecordedTask(requester, number, now_s))

    def _deny_asked(self, now_s: float, refusal: Refusal = HALTED) -> None:
        """Refuse requests that are not recorded yet, and drop the remaining steps of looking ahead."""
        self._turns.clear()
        if self._head is not None:
            self._head.stay()
        for kind, waiting in self._asked.items():
            denied, waiting[:] = list(waiting), []
            for asked in denied:
                self._answer(kind, asked, refusal, now_s)

    def _answer(self, kind: str, asked: RecordedTask, refusal: Refusal | None, now_s: float) -> None:
        """Answer the requester and record the result."""
        asked.requester.answer(refusal)
        self._records.outcome(asked, kind, refusal.code if refusal else "sent", {}, now_s)

    def _granted(self, kind: str, now_s: float, barred: Refusal | None = None) -> bool:
        """Answer recorded requests of this kind. Return whether one of them may be carried out.

        `barred`: a refusal that holds for all of them.
        """
        granted = False
        for asked in pop_due(self._asked[kind]):
            refusal = asked.unrecorded or self._rules.why_not_begin(asked.requester, now_s)
            refusal = refusal or self._why_not[kind](now_s) or barred
            granted = granted or refusal is None
            self._answer(kind, asked, refusal, now_s)
        return granted

    def _why_not_forget(self, now_s: float) -> Refusal | None:
        """Return a refusal if the gate needs its memory: the base or the arm moves."""
        if self.motions.refuse(now_s):
            text = "The robot performs a motion, which needs the gate’s memory."
            return Refusal("motion_running", text, "robot")
        return self._rules.why_not_still(now_s)

    # --- head -------------------------------------------------------------------------------------

    def _why_no_look(self, now_s: float) -> Refusal | None:
        if self._head is None:
            return Refusal("no_head", "This robot has no head that can be turned.", "robot")
        if refusal := self._rules.why_closed(now_s):
            return refusal
        if self.motions.refuse(now_s):
            text = "The robot performs a motion, which may move its head."
            return Refusal("motion_running", text, "robot")
        return self.navigation.busy()

    def _turn_head(self, order: wire.TurnHead, requester: Requester, now_s: float) -> None:
        """Turn the head. A drag in the camera's picture causes many turns: only the first is recorded."""
        fence, until_s = self._turning
        if self._head is None or order.fence != fence or now_s > until_s:
            asked = len(self._asked["head.turn"])
            self._ask("head.turn", requester, now_s)
            if len(self._asked["head.turn"]) > asked:  # else it was refused
                self._turns = [*self._turns[-MOST_TURNS:], order]
            return
        refusal = self._rules.why_not_begin(requester, now_s) or self._why_no_look(now_s)
        requester.answer(refusal)
        if refusal is None:
            self._turning = fence, now_s + TURNS_S
            self._performer.aim_head(self._head.turn(order.pan, order.tilt, self._performer.head_at(), now_s))

    def _turned(self, now_s: float) -> Aim | None:
        """Return the aim of turns that were recorded just now."""
        turns, self._turns = self._turns, []
        for turn in turns:
            self._turning = turn.fence, now_s + TURNS_S
        if self._head is None or not turns:
            return None
        pan, tilt = sum(turn.pan for turn in turns), sum(turn.tilt for turn in turns)
        return self._head.turn(pan, tilt, self._performer.head_at(), now_s)

    def _move_head(self, sent: Velocity, now_s: float) -> None:
        """Move the head: ahead for a drive to a place; down and ahead after a recorded request; else into the turn.

        If a rule forbids a later step of looking ahead, the head stays down, and the gate limits the speed.
        """
        if self._head is None:
            return
        aim = None
        if self._granted("head.look_ahead", now_s):
            aim = self._head.ahead(self._gate.look_to(now_s), now_s)
        elif self._granted("head.turn", now_s):
            aim = self._turned(now_s)
        elif self.navigation.driving_requester or self.navigation.due:
            aim = self._head.forward(now_s)  # the gate's camera looks where it drives
        elif (onward := self._head.onward(now_s)) is not None:
            aim = onward if self._why_no_look(now_s) is None else None
        elif self._rules.lease.current and sent != STILL and self._why_no_look(now_s) is None:
            aim = self._head.follow(sent, now_s)
        if aim is not None:
            self._performer.aim_head(aim)

    # --- publishing -----------------------------------------------------------------------------------

    def _publish(self, order: wire.Publish, grant: Grant, requester: Requester, now_s: float) -> None:
        if order.type in twists.TYPES:
            requester.answer(self._twist(order, grant, now_s))
            return
        refusal = self._rules.why_not_begin(requester, now_s) or self._why_not_publish(order)
        if refusal is not None:
            requester.answer(refusal)
            return

        def checked(refusal: Refusal | None, now_s: float) -> None:
            # Check again: control may have been lost, or stop pressed.
            refusal = refusal or self._rules.why_not_begin(requester, now_s)
            if refusal is None:
                self.publications.begin(order, requester, now_s)
            else:
                requester.answer(refusal)

        self._publisher.check(order, checked)

    def _why_not_publish(self, order: wire.Publish) -> Refusal | None:
        """Return a refusal if the allow-list does not have this topic and type."""
        wanted = ("publish", order.topic, order.type)
        if any((allowed.what, allowed.name, allowed.type) == wanted for allowed in self._config.allowed):
            return None
        text = f"The allow-list does not contain {order.topic} with type {order.type}."
        return Refusal("not_allowed", text, "robot", {"topic": order.topic, "type": order.type})

    def _twist(self, order: wire.Publish, grant: Grant, now_s: float) -> Refusal | None:
        """Pass a velocity through the gate.

        Only one topic takes velocities, and each velocity must be sent again in time.
        """
        topic, type_name = self.routing.topic("drive"), self._config.topics.drive.type
        if (order.topic, order.type) != (topic, type_name):
            text = f"Publish velocities on {topic} as {type_name} only: they pass the gate there."
            return Refusal("around_the_gate", text, "gate", {"topic": topic, "type": type_name})
        if order.rate_hz:
            text = f"A velocity is valid for {COMMAND_LIFE_S} s: send it again yourself, without a rate."
            return Refusal("dead_man", text, "dead-man")
        velocity = twists.velocity_from(order.fields, order.type)
        if isinstance(velocity, Refusal):
            return velocity
        return self._rules.twist(velocity, order, grant, now_s)

    # --- drives by a distance or an angle -------------------------------------------------------------

    def _drive_by(self, order: wire.DriveBy, grant: Grant, requester: Requester, now_s: float) -> None:
        refusal = self.drives_by.refuse(order, grant.max_share) or self._why_no_drive(requester, now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        self.drives_by.begin(order, grant.max_share, requester, now_s)

    def _why_no_drive(self, requester: Requester, now_s: float) -> Refusal | None:
        """Return the first rule that forbids to begin a drive. The core judges each velocity afterwards."""
        return (
            self._rules.why_not_begin(requester, now_s)
            or self.why_stand(now_s, crawls=True)
            or self._rules.why_not_still(now_s)
        )

    # --- gripper and torso ------------------------------------------------------------------------------

    def _why_no_limb(self, requester: Requester, now_s: float) -> Refusal | None:
        """Return the first rule of all tasks that forbids to move a limb: as for a motion, the base must stand."""
        return (
            self._rules.why_not_begin(requester, now_s)
            or self.motions.refuse(now_s)
            or self._rules.why_not_still(now_s)
        )

    # --- drives to a place ------------------------------------------------------------------------------

    def _go(self, order: wire.Go, requester: Requester, now_s: float) -> None:
        self.navigation.controlled(order.fence, now_s)
        refusal = self.navigation.busy() or self._why_not_go(order, requester, now_s)
        if refusal is not None and not self.navigation.may_come(refusal, now_s):
            requester.answer(refusal)
            return
        self.navigation.begin(order, requester, now_s)

    def _why_not_go(self, order: wire.Go, requester: Requester, now_s: float) -> Refusal | None:
        """Return the first rule that forbids a drive to a place. Other goals are checked elsewhere."""
        return (
            self._rules.why_not_begin(requester, now_s)
            or self.why_stand(now_s)
            or self._rules.why_not_still(now_s)
            or (NO_WATCHDOG if self._rules.watchdog_missing else None)
            or self.navigation.refuse_map(order.map)
            or self.navigation.refuse(
                Pose(order.x, order.y, order.heading), self.routing.topic("drive"), now_s
            )
        )

    def _watch_navigation(self, now_s: float) -> None:
        """Run navigation's periodic work. Send the goal that is due, if no rule forbids it."""
        grant = self._rules.lease.current
        still = self._gate.standstill(now_s)
        self.navigation.tick(now_s, grant.fence if grant else None, still)
        if self.navigation.unrecorded:
            self.navigation.start(now_s)
        if (order := self.navigation.due) is None or (requester := self.navigation.waiting) is None:
            return
        refusal = self._why_not_go(order, requester, now_s)
        if refusal is None or not self.navigation.may_come(refusal, now_s):
            if refusal is not None:
                self.navigation.deny(refusal, now_s)
            self.navigation.start(now_s)

    def _set_pose(self, order: wire.SetPose, requester: Requester, now_s: float) -> None:
        self.navigation.controlled(order.fence, now_s)
        refusal = self.navigation.refuse_map(order.map)
        if refusal is not None and not self.navigation.may_come(refusal, now_s):
            requester.answer(refusal)
            return
        place = {"x_m": order.x, "y_m": order.y, "heading_rad": order.heading}
        asked = len(self._asked["pose.set"])
        self._ask("pose.set", requester, now_s, place)
        if len(self._asked["pose.set"]) > asked:  # else it was refused
            self._pose = order

    def _place(self, now_s: float) -> None:
        """Send the robot the pose that is recorded. It waits for the map, which is read when control begins."""
        if self._pose is None:
            return
        refusal = self.navigation.refuse_map(self._pose.map)
        if refusal is not None and self.navigation.may_come(refusal, now_s):
            return
        if self._granted("pose.set", now_s, refusal):
            self._performer.set_pose(Pose(self._pose.x, self._pose.y, self._pose.heading))
        if not self._asked["pose.set"]:
            self._pose = None

    def _why_not_set_pose(self, now_s: float) -> Refusal | None:
        navigation = self._config.topics.navigation
        if navigation is None or navigation.set_pose is None:
            return NO_NAVIGATION
        return self.navigation.busy() or self._rules.why_not_still(now_s)

    # --- motions --------------------------------------------------------------------------------------

    def _play(self, order: wire.Play, requester: Requester, now_s: float) -> None:
        """Record the motion and read its present points in parallel, because both take a while."""
        refusal = self.motions.refuse(now_s) or self._why_no_motion(requester, None, now_s)
        # The last survey is seconds old: a subscriber may have joined since.
        if refusal is not None and refusal.code != "no_listener":
            requester.answer(refusal)
            return
        action = self.routing.topic("motions")
        title = self.capabilities.title_of(order.motion, action)
        goal = self.motions.begin(order.motion, title, action, requester, now_s)

        def swept(space: tuple[Disc, ...] | None, now_s: float) -> None:
            self.motions.take_space(goal, space, now_s, self.routing.refuse("motions", action))
            self._watch_motion(now_s)

        self._performer.sweep(order.motion, action, swept)

    def _cancel_motion(self, why: str) -> Refusal | None:
        if self.motions.cancel("cancelled", why):
            return None
        return Refusal("no_motion", "No motion of this console runs.", "robot")

    def _why_no_motion(self, requester: Requester, action: str | None, now_s: float) -> Refusal | None:
        """Return the first rule that forbids a motion. Other motions and the arm's space are checked elsewhere."""
        return (
            self._rules.why_not_begin(requester, now_s)
            or self.routing.refuse("motions", action)
            or self.limbs.busy()
            or self._rules.why_not_still(now_s)
        )

    def _watch_motion(self, now_s: float) -> None:
        """Start the motion that is due, if no rule forbids it; cancel a motion that must not continue."""
        motions = self.motions
        if motions.due:
            if requester := motions.waiting:
                refusal = self._why_no_motion(requester, motions.topic, now_s)
                refusal = refusal or self._clearance.refuse(motions.space, now_s)
                if refusal is not None:
                    motions.deny(refusal, now_s)
            motions.start(now_s)
        elif motions.begun and (refusal := self._clearance.refuse(motions.space, now_s, running=True)):
            motions.cancel(OUTCOMES[refusal.code], refusal.text)
        motions.tick(now_s)

    # --- speech ---------------------------------------------------------------------------------------

    def _say(self, order: wire.Say, requester: Requester, now_s: float) -> None:
        refusal = why_not_speakable(order.text) or self._rules.why_not_begin(requester, now_s)
        refusal = refusal or self.routing.refuse("speech", order.topic) or self.speech.refuse(now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        language = robot_language(order.language, self._config.topics.languages)
        utterance = Utterance(order.text, language, order.topic or self.routing.topic("speech"))
        self.speech.begin(utterance, requester, now_s)

    def _cancel_speech(self, why: str) -> Refusal | None:
        if self.speech.cancel("cancelled", why):
            return None
        return Refusal("no_speech", "The robot speaks no text of this console.", "robot")

    def _watch_speech(self, now_s: float) -> None:
        """Speak a recorded text, unless a rule now forbids it."""
        requester = self.speech.waiting
        if requester and (refusal := self._rules.why_not_begin(requester, now_s)):
            self.speech.cancel("cancelled", refusal.text)
        self.speech.start(self.routing.connected("speech"), now_s)
        self.speech.tick(now_s)


def holder_of(grant: Grant) -> Holder:
    """Return the person who is responsible for tasks under this grant."""
    return Holder(grant.holder_id, grant.holder, grant.session, grant.fence)
