"""Speak one text at a time: which texts can be spoken, and the progress of the text being spoken.

A text is recorded before it is sent. It is spoken to its end even when its holder loses control; only a cancel and the
emergency stop end it, by its goal's id.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from msgspec import Struct

from robots.bridge.audit.records import Requester
from robots.bridge.tasks.goals import Goal, Goals
from robots.bridge.tasks.input_routing import InputRouting
from robots.bridge.tasks.task import Cause, Context, Ending, Reaction, TaskPart
from robots.shared import wire
from robots.shared.configuration.spoken_texts import why_not_speakable
from robots.shared.records.record_sink import Parameters
from robots.shared.sentences import say
from robots.shared.wire import Grant, Refusal

# Keep a topic that is no action connected this long: its text waits one second for new subscribers.
LINGER_S = 1.5


def robot_language(asked: str, own: Sequence[str]) -> str:
    """Return the robot's tag (BCP 47) for a language among `own`; else the tag that was asked for.

    Prefer the same tag (upper or lower case), else the first tag of the same language: a voice may have
    es-ES, but neither es nor es-MX.
    """
    same = [tag for tag in own if tag.lower() == asked.lower()]
    akin = [tag for tag in own if _primary(tag) == _primary(asked)]
    return next(iter(same + akin), asked)


def _primary(tag: str) -> str:
    return tag.lower().partition("-")[0]


def find_spoken_word(text: str, said: str, after: int = 0) -> tuple[int, int] | None:
    """Return the position of the last word of `said` in `text`: first character and end.

    Some robots report all words so far, others only the newest word. Search a single word from `after` on.
    """
    spoken = said.split()
    if not spoken:
        return None
    words = list(re.finditer(r"\S+", text))
    if [word.group() for word in words[: len(spoken)]] == spoken and not (after and len(spoken) == 1):
        return words[len(spoken) - 1].span()
    found = text.find(spoken[-1], after)
    return (found, found + len(spoken[-1])) if found >= 0 else None


class Utterance(Struct, frozen=True):
    """A text and its topic (for an action, the action's name)."""

    text: str
    language: str
    topic: str


class SpeechOutput(ABC):
    """Speaks texts."""

    @abstractmethod
    def say(self, goal_id: str, utterance: Utterance) -> bool:
        """Send the text. Return whether the robot reports its progress."""

    @abstractmethod
    def cancel_speech(self, goal_id: str, topic: str) -> None:
        """Cancel this goal and no other."""


@dataclass
class _SpeechGoal:
    """A text and its progress."""

    utterance: Utterance
    status: wire.SpeechStatus = "sent"
    word: tuple[int, int] | None = None


class SpeechTasks(Goals[_SpeechGoal], TaskPart):
    """The text being spoken, if any."""

    kinds = (wire.SPEECH,)
    reactions = {
        Cause.CANCELLED: Reaction.END,
        Cause.SUPERSEDED: Reaction.GO_ON,
        Cause.GATE: Reaction.GO_ON,
        Cause.HALTED: Reaction.GO_ON,
        Cause.ROBOT_GONE: Reaction.GO_ON,
        Cause.STOPPED: Reaction.END,
        Cause.CONTROL_ENDED: Reaction.DROP,
        Cause.PAGE_LEFT: Reaction.DROP,
        Cause.LINK_LOST: Reaction.GO_ON,
        Cause.UNRECORDED: Reaction.DROP,
        Cause.BRIDGE_ENDED: Reaction.LEAVE,
    }
    outcomes = {Cause.CONTROL_ENDED: "cancelled"}
    answered_within_s = 5.0  # nothing moves if a robot whose computer is busy begins late
    no_task = Refusal("no_speech", "The robot speaks no text of this console.", "robot")

    def __init__(self, context: Context) -> None:
        super().__init__(context.records, self._cancel_on_robot)
        self._context = context
        self._sent: dict[str, float] = {}  # time of the last text, by topic that is no action
        self.last: wire.SpeechEnd | None = None  # how the last text ended, for pages

    def _cancel_on_robot(self, goal_id: str, topic: str) -> None:
        if voice := self._context.robot.part(SpeechOutput):
            voice.cancel_speech(goal_id, topic)

    def take(self, order: wire.Say, grant: Grant, requester: Requester, now_s: float) -> None:
        routing = self._context.tasks.part(InputRouting)
        refusal = why_not_speakable(order.text) or self._context.rules.why_not_begin(requester, now_s)
        refusal = refusal or routing.refuse("speech", order.topic) or self.refuse(now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        language = robot_language(order.language, self._context.config.topics.languages)
        topic = order.topic or routing.topic("speech")
        parameters = {"text": order.text, "language": language, "topic": topic}
        number = self._records.request(requester.holder, wire.SPEECH.record, parameters, now_s)
        utterance = Utterance(order.text, language, topic)
        self._current = Goal(requester, number, now_s, _SpeechGoal(utterance), topic)

    def topics_in_use(self, use: wire.Use, now_s: float) -> set[str]:
        if use != "speech":
            return set()
        self._sent = {topic: sent_s for topic, sent_s in self._sent.items() if now_s - sent_s <= LINGER_S}
        return {*self._sent, *([self.topic] if self.topic else [])}

    def refuse(self, now_s: float) -> Refusal | None:
        """Return why no other text can be spoken: the robot speaks."""
        goal = self._current
        if goal is not None:
            who, text = goal.requester.holder.holder, goal.what.utterance.text
            reason = say(
                "The robot says “{text}”, requested by {who}: cancel it or wait.",
                text=_short(text),
                who=who,
            )
            return Refusal("speaking", reason, "robot", {"who": who, "text": text})
        if self._busy(now_s):
            return Refusal("speaking", "The robot speaks a text from another program: wait.", "robot")
        return None

    def tick(self, now_s: float) -> None:
        """Speak a recorded text, unless a rule now forbids it."""
        requester = self.waiting
        if requester and (refusal := self._context.rules.why_not_begin(requester, now_s)):
            self.cancel("cancelled", refusal.sentence)
        self._start(self._context.tasks.part(InputRouting).connected("speech"), now_s)
        super().tick(now_s)

    def _start(self, connected: Collection[str], now_s: float) -> None:
        """Send a recorded text that was not cancelled, if its topic is among the `connected` topics."""
        goal, voice = self._once_recorded(now_s), self._context.robot.part(SpeechOutput)
        if goal is not None and goal.topic in connected and voice is not None:
            tells = voice.say(goal.sent(now_s), goal.what.utterance)
            if not tells:
                self._sent[goal.topic] = now_s
                self._end("sent", "", now_s)

    def leave(self, ending: Ending, now_s: float) -> None:
        """End the task: the bridge ends. The robot may continue to speak, but nobody observes it."""
        self._end("unheard", say("The bridge ended while the robot spoke."), now_s)

    def state(self, now_s: float) -> dict[str, Any]:
        return {"speech": self.view(now_s), "speech_ended": self.last}

    def headline(self, now_s: float) -> tuple[object, ...]:
        speech = self.view(now_s)
        return (speech and (speech.number, speech.status, speech.word), self.last)

    def view(self, now_s: float) -> wire.Speech | None:
        """Return the text being spoken, for pages, from the moment it was sent."""
        goal = self._current
        if goal is None or goal.id is None:
            return None
        saying = goal.what
        return wire.Speech(
            number=goal.number.result(),
            text=saying.utterance.text,
            language=saying.utterance.language,
            topic=saying.utterance.topic,
            who=goal.requester.holder.holder,
            status=saying.status,
            since_s=round(now_s - goal.since_s, 1),
            word=saying.word,
        )

    def running(self, topic: str, goals: Mapping[str, wire.SpeechStatus], now_s: float) -> None:
        """Take the robot's report of active goals on a topic: accepted or speaking."""
        goal = self._find_own(topic, goals, now_s)
        if goal is not None and goal.id is not None:
            goal.what.status = goals[goal.id]

    def said(self, goal_id: str, said: str, now_s: float) -> None:
        """Note that the robot began a word: `said` ends with it."""
        goal = self._current
        if goal is not None and goal.id == goal_id:
            goal.heard_s, goal.reported = now_s, True
            saying = goal.what
            saying.word = find_spoken_word(saying.utterance.text, said, saying.word[1] if saying.word else 0)

    def _report_end(self, goal: Goal[_SpeechGoal], outcome: str, text: str) -> None:
        self.last = wire.SpeechEnd(goal.number.result(), outcome, text)

    def _record(self, goal: Goal[_SpeechGoal], outcome: str, text: str, now_s: float) -> None:
        figures: Parameters = {"text": text, "duration_s": round(now_s - goal.since_s, 2)}
        self._records.outcome(goal, wire.SPEECH.outcome, outcome, figures, now_s)


def _short(text: str) -> str:
    """Shorten a text to fit into a sentence.

    Isolate its direction of writing, for example of Arabic in an English sentence.
    """
    one_line = " ".join(text.split())
    return f"\u2068{one_line if len(one_line) <= 60 else f'{one_line[:59]}…'}\u2069"
