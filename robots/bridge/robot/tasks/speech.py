"""The robot's voices: the default and chosen ones, and what they report."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from typing import Protocol

from robots.bridge.robot.incoming.mailboxes import EVENTS_WAIT
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.tasks.goals import OURS
from robots.bridge.tasks.speech import SpeechOutput, Utterance
from robots.shared.configuration.bridge_config import Topic
from robots.shared.texts import SAID, cut
from robots.shared.wire import SpeechStatus


class Voice(Protocol):
    """An action or a topic that speaks. What it reports goes to `SpeechReports`."""

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        """Send a text. Returns whether progress and end will be reported."""

    def cancel(self, goal_id: str) -> None:
        """Cancel this goal and no other."""

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""

    def close(self) -> None:
        """Leave the topics."""


class Voices(SpeechOutput, RobotPart):
    """The voices of one robot. `connect` connects one; it asks the robot."""

    def __init__(self, default: Topic, connect: Callable[[Topic], Voice]) -> None:
        self._types = {one.name: one.type for one in (default, *default.others)}
        self._type = default.type  # of topics that were chosen
        self._connect = connect
        self._voices: dict[str, Voice] = {}
        self.attend({default.name})

    def attend(self, topics: Collection[str]) -> None:
        """Connect to these topics and no others. Asks the robot."""
        for name in set(topics) - set(self._voices):
            self._voices[name] = self._connect(Topic(name, self._types.get(name, self._type)))
        for name in set(self._voices) - set(topics):
            self._voices.pop(name).close()

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        return self._voices[utterance.topic].say(goal_id, utterance)

    def cancel_speech(self, goal_id: str, topic: str) -> None:
        if topic in self._voices:
            self._voices[topic].cancel(goal_id)

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [voice.cancel_all for voice in list(self._voices.values())]


class SpeechReports:
    """Reports of a voice, from the threads of the side to the tasks on the event loop."""

    def __init__(self, node: Node) -> None:
        self._mail = node.mail
        self._tasks = node.tasks.speech

    def running(self, action: str, statuses: Mapping[str, SpeechStatus]) -> None:
        """Take the running goals of all senders."""
        self._mail.post(
            ("speech", action),
            lambda: self._tasks.running(action, statuses, time.monotonic()),
            can_wait=True,
        )

    def said(self, goal_id: str, text: str) -> None:
        """Take the word that a goal says now. Only our own goals are reported."""
        if goal_id.startswith(OURS):
            said = cut(text, SAID)
            self._mail.post("said", lambda: self._tasks.said(goal_id, said, time.monotonic()), EVENTS_WAIT)

    def ended(self, goal_id: str, outcome: str, text: str) -> None:
        """Take the end of a goal, with the robot's text. Only our own goals are reported."""
        if goal_id.startswith(OURS):
            outcome = "done" if outcome == "succeeded" else outcome
            self._mail.post(
                "speech ended",
                lambda: self._tasks.ended(goal_id, outcome, text, time.monotonic()),
                EVENTS_WAIT,
            )
