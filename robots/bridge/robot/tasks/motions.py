"""Recorded motions as a robot lists them: what is offered, the space that one sweeps, how one ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from typing import Protocol

from msgspec import structs

from robots.bridge.arm.clearance import ArmModel
from robots.bridge.gate.arm.discs import Disc
from robots.bridge.gate.arm.sweep import Motion
from robots.bridge.robot.incoming.mailboxes import EVENTS_WAIT
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.robot.worker import RateLimit, Worker
from robots.bridge.tasks.goals import OURS
from robots.bridge.tasks.input_routing import goal_topic
from robots.bridge.tasks.motions import MotionPlayer, Swept, offered, recorded
from robots.shared.configuration.bridge_config import Topic
from robots.shared.sentences import joined, say
from robots.shared.texts import MOST_MOTIONS, PARAGRAPH, SENTENCE, TITLE, cut
from robots.shared.unreachable import Unreachable
from robots.shared.wire import MotionOffer

# between two reads of the motions: a read takes up to 0.2 s, and a server may connect often
JOINED_GAP_S = 5.0
REACH_M = 1.3  # of an arm that the profile does not describe, around the middle of the base


class MotionAction(Protocol):
    """One motion action of the robot. What it reports goes to `RecordedMotions`."""

    def play(self, goal_id: str, motion: str) -> None:
        """Send the goal. Planning is never skipped."""

    def cancel(self, goal_id: str) -> None:
        """Cancel this goal and no other."""

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""


class RecordedMotions(MotionPlayer, ArmModel, RobotPart):
    """The motion actions of one robot, and the position of the arm that they move.

    The actions: the default, and those that people may choose instead, of one type; `connect` connects one. It calls
    `joined` whenever a motion server connects, which may have other motions than before: they are read again.
    """

    def __init__(self, node: Node, connect: Callable[[str, RecordedMotions], MotionAction]) -> None:
        self._node = node
        self._arm = node.posture if node.config.topics.arm else None
        self._list_worker = Worker("motions")
        self._sweeping = Worker("motion")  # not on `_list_worker`, where a list may take seconds
        self.repertoire: dict[str, Mapping[str, Motion | None]] = {}  # by action; None: points unknown
        # By action: motions, and why there are none.
        self._offers: dict[str, tuple[list[MotionOffer], str]] = {}
        self.joined = RateLimit(self.read_motions, JOINED_GAP_S).do
        # A server may connect, and its motions be read, while further actions are added.
        self._actions: dict[str, MotionAction] = {}
        for name in node.tasks.routing.connected("motions"):
            self._actions[name] = connect(name, self)

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
        self._actions[action].play(goal_id, motion)

    def cancel(self, goal_id: str, action: str) -> None:
        self._actions[action].cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [action.cancel_all for action in self._actions.values()]

    # --- on the threads of the side --------------------------------------------------------------------

    def running(self, action: str, goal_ids: Collection[str]) -> None:
        """Take the running goals of all senders."""
        self._node.mail.post(
            ("motions", action),
            lambda: self._node.tasks.motions.running(action, goal_ids, time.monotonic()),
            can_wait=True,
        )

    def ended(self, goal_id: str, outcome: str, text: str, error: str) -> None:
        """Take the end of a goal, with the robot's text and its error in words. Only our own goals are reported."""
        if not goal_id.startswith(OURS):  # other senders' goals matter only while they run
            return
        sentences = [text] if outcome in {"succeeded", "cancelled"} else [error, text]
        words = cut(_sentence([part for part in sentences if part]), SENTENCE)
        self._node.mail.post(
            "motions ended",
            lambda: self._node.tasks.motions.ended(goal_id, outcome, words, time.monotonic()),
            EVENTS_WAIT,
        )


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
