"""Recorded motions over play_motion's action: their list, the space of one, and goals with our own ids."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from msgspec import structs

from robots.bridge.arm.clearance import ArmModel
from robots.bridge.gate.arm.discs import Disc
from robots.bridge.gate.arm.sweep import Motion
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.worker import RateLimit, Worker
from robots.bridge.ros.tasks.actions import EVENTS_WAIT, ActionTopics, GoalListener
from robots.bridge.tasks.goals import OURS
from robots.bridge.tasks.input_routing import goal_topic
from robots.bridge.tasks.motions import MotionPlayer, Swept, offered, recorded
from robots.shared.configuration.bridge_config import Topic
from robots.shared.ros.message_types.classes import message_class
from robots.shared.sentences import joined, say
from robots.shared.texts import MOST_MOTIONS, PARAGRAPH, SENTENCE, TITLE, cut
from robots.shared.unreachable import Unreachable
from robots.shared.wire import MotionOffer

# between two reads of the motions: a read takes up to 0.2 s, and a server may connect often
JOINED_GAP_S = 5.0
REACH_M = 1.3  # of an arm that the profile does not describe, around the middle of the base
ERRORS = {  # PlayMotionResult's codes in words
    "MOTION_NOT_FOUND": say("the robot does not know this motion"),
    "CONTROLLER_BUSY": say("something else moves these joints"),
    "MISSING_CONTROLLER": say("the controller of these joints does not run"),
    "TRAJECTORY_ERROR": say("the controller does not take this motion"),
    "GOAL_NOT_REACHED": say("the joints did not get to where they should"),
    "PLANNER_OFFLINE": say("the robot’s motion planner does not run"),
    "NO_PLAN_FOUND": say("the robot found no way to its first posture without a collision"),
    "OTHER_ERROR": say("the robot does not say why"),
}


class MotionTopics(MotionPlayer, ArmModel, RobotPart, GoalListener):
    """The motion actions of one robot, and the position of the arm that they move.

    The actions: the default, and those that people may choose instead, of one type. Changes of goals are reported to
    the node's tasks on the event loop. The motions are read again whenever a motion server connects: it may have
    other motions than before.
    """

    def __init__(self, node: Node, type: str) -> None:
        self._node = node
        self._arm = node.posture if node.config.topics.arm else None
        self._list_worker = Worker("motions")
        self._sweeping = Worker("motion")  # not on `_list_worker`, where a list may take seconds
        self._errors = _errors(message_class(f"{type.removesuffix('Action')}Result"))
        self.repertoire: dict[str, Mapping[str, Motion | None]] = {}  # by action; None: points unknown
        # By action: motions, and why there are none.
        self._offers: dict[str, tuple[list[MotionOffer], str]] = {}
        joined = RateLimit(self.read_motions, JOINED_GAP_S)
        # A server may connect, and its motions be read, while further actions are added.
        self._actions: dict[str, ActionTopics] = {}
        for name in node.tasks.routing.connected("motions"):
            self._actions[name] = ActionTopics(Topic(name, type), self, joined=joined.do)

    @classmethod
    def of(cls, node: Node) -> MotionTopics | None:
        motions = node.config.topics.motions
        return cls(node, motions.type) if motions else None

    def read_motions(self) -> None:
        self._list_worker.do(self.read)

    def surveyed(self) -> None:
        """Read the motions if none is known yet."""
        if not any(self.repertoire.values()):
            self.read_motions()

    def read(self) -> None:
        """Read the robot's motions: names from its service, the rest from its parameters.

        Reports the motions of each action, or the reason why there are none.
        """
        source = self._node.parameters
        for action in list(self._actions):
            try:
                parameters, listed = source.motions(action), source.listed_motions(action)
            except Unreachable as error:  # the known motions stay
                self._offers.setdefault(action, ([], error.args[0]))
            else:
                self.repertoire[action] = recorded(parameters, listed)
                offers = offered(parameters, listed)
                words = "" if offers else say("{action} offers no motions.", action=action)
                if len(offers) > MOST_MOTIONS:
                    words = say(
                        "{action} offers {count} motions; {most} are shown.",
                        action=action,
                        count=len(offers),
                        most=MOST_MOTIONS,
                    )
                self._offers[action] = [_cut(offer) for offer in offers[:MOST_MOTIONS]], words
            self._offer(action, *self._offers[action])

    def _offer(self, action: str, motions: list[MotionOffer], text: str) -> None:
        self._node.post(lambda: self._node.tasks.capabilities.read(action, motions, text))

    def sweep(self, motion: str, action: str, then: Swept) -> None:
        self._sweeping.do(lambda: self._sweep(motion, action, then))

    def _sweep(self, motion: str, action: str, then: Swept) -> None:
        self._node.find_listener(goal_topic(Topic(action, "Action")).name)
        space = None
        with suppress(KeyError):
            points, is_news = self.look_up(action, motion)
            if is_news:
                self.read_motions()
            now_s = time.monotonic()
            space = self._arm.sweep(points, now_s) if self._arm else ((0.0, 0.0, REACH_M),)
        self._node.post(lambda: then(space, time.monotonic()))

    def arm(self) -> tuple[Disc, ...] | None:
        return None if self._arm is None else self._arm.arm(time.monotonic())

    def arm_problem(self) -> str:
        return "" if self._arm is None else self._arm.problem(time.monotonic())

    def look_up(self, action: str, motion: str) -> tuple[Motion | None, bool]:
        """Return the robot's present motion (None: points unknown), and whether it differs from the last `read`.

        One call to the robot. KeyError if there is no such motion, Unreachable if the robot does not answer.
        """
        now = recorded({motion: self._node.parameters.motions(action, motion)})[motion]
        read = self.repertoire.get(action, {})
        if now is None and motion not in read:
            raise KeyError(motion)
        return now, motion not in read or read[motion] != now

    def play(self, goal_id: str, motion: str, action: str) -> None:
        """Send the goal. Planning is never skipped."""
        topics = self._actions[action]
        goal = topics.goal_class()
        goal.goal_id.id = goal_id
        goal.goal.motion_name = motion
        topics.send(goal)

    def cancel(self, goal_id: str, action: str) -> None:
        self._actions[action].cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [action.cancel_all for action in self._actions.values()]

    # --- on rospy's threads (actions.GoalListener) ----------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        self._node.mail.post(
            ("motions", action),
            lambda: self._node.tasks.motions.running(action, goals.keys(), time.monotonic()),
            can_wait=True,
        )

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        """Report the end of one of our goals, with the robot's text and its error code in words."""
        if not goal_id.startswith(OURS):  # other senders' goals matter only while they run
            return
        sentences = [self._code_words(result.error_code), cut(result.error_string, SENTENCE) or text]
        if outcome in {"succeeded", "cancelled"}:
            sentences = sentences[1:]
        words = cut(_sentence([part for part in sentences if part]), SENTENCE)
        self._node.mail.post(
            "motions ended",
            lambda: self._node.tasks.motions.ended(goal_id, outcome, words, time.monotonic()),
            EVENTS_WAIT,
        )

    def _code_words(self, code: int) -> str:
        """Return the words of an error code; unknown codes keep their number."""
        return self._errors.get(code) or (say("error code {code}", code=code) if code else "")


def _errors(result: type[Any]) -> dict[int, str]:
    return {getattr(result, name): words for name, words in ERRORS.items()}


def _cut(offer: MotionOffer) -> MotionOffer:
    """Cut the texts for the page. A motion whose name was cut cannot be played."""
    return structs.replace(
        offer,
        name=cut(offer.name, TITLE),
        title=cut(offer.title, TITLE),
        usage=cut(offer.usage, TITLE),
        description=cut(offer.description, PARAGRAPH),
    )


def _sentence(parts: list[str]) -> str:
    return say("{text:capital}", text=joined(": ", parts)) if parts else ""
