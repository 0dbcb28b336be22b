"""Speak one text at a time: which texts can be spoken, and the progress of the text being spoken.

A text is recorded before it is sent. It is spoken to its end even when its holder loses control; only a cancel and the
emergency stop end it, by its goal's id. `cancel` is in `goals.py`; a page's press arrives at `holder_tasks.py`.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from msgspec import Struct

from robots import wire
from robots.bridge.audit.record_sink import Parameters
from robots.bridge.audit.records import Records, Requester
from robots.bridge.tasks.goals import Goal, Goals
from robots.wire import Refusal

LONGEST_CHARACTERS = 500
# Keep a topic that is no action connected this long: its text waits one second for new subscribers.
LINGER_S = 1.5
_LAYOUT = frozenset("\n\t")


def why_not_speakable(text: str) -> Refusal | None:
    """Return why a robot cannot speak this text; None if it can."""
    for position, character in enumerate(text):
        if character not in _LAYOUT and unicodedata.category(character) in {"Cc", "Cs"}:
            reason = f"Character {position + 1} (U+{ord(character):04X}) cannot be spoken: delete it."
            return Refusal("control_characters", reason, "robot", {"position": position})
    if not any(character.isprintable() and not character.isspace() for character in text):
        return Refusal("empty_text", "The text is empty: write a text first.", "robot")
    if len(text) > LONGEST_CHARACTERS:
        reason = f"The text has {len(text)} characters; the limit is {LONGEST_CHARACTERS}."
        figures = {"length": len(text), "limit": LONGEST_CHARACTERS}
        return Refusal("text_too_long", reason, "robot", figures)
    return None


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


class SpeechOutput(Protocol):
    """Speaks texts."""

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        """Send the text. Return whether the robot reports its progress."""

    def cancel_speech(self, goal_id: str, topic: str) -> None:
        """Cancel this goal and no other."""


@dataclass
class _SpeechGoal:
    """A text and its progress."""

    utterance: Utterance
    status: wire.SpeechStatus = "sent"
    word: tuple[int, int] | None = None


class SpeechTasks(Goals[_SpeechGoal]):
    """The text being spoken, if any."""

    def __init__(self, voice: SpeechOutput, records: Records) -> None:
        super().__init__(records, voice.cancel_speech)
        self._voice = voice
        self._sent: dict[str, float] = {}  # time of the last text, by topic that is no action
        self.last: wire.SpeechEnd | None = None  # how the last text ended, for pages

    def topics(self, now_s: float) -> set[str]:
        """Return topics on which a text is being spoken or is about to be."""
        self._sent = {topic: sent_s for topic, sent_s in self._sent.items() if now_s - sent_s <= LINGER_S}
        return {*self._sent, *([self.topic] if self.topic else [])}

    def refuse(self, now_s: float) -> Refusal | None:
        """Return why no other text can be spoken: the robot speaks."""
        goal = self._current
        if goal is not None:
            who, text = goal.requester.holder.holder, goal.what.utterance.text
            reason = f"The robot says “{_short(text)}”, requested by {who}: cancel it or wait."
            return Refusal("speaking", reason, "robot", {"who": who, "text": text})
        if self._busy(now_s):
            return Refusal("speaking", "The robot speaks a text from another program: wait.", "robot")
        return None

    def begin(self, utterance: Utterance, requester: Requester, now_s: float) -> None:
        """Record the request. `start` then sends the text and answers the requester."""
        text, language, topic = utterance.text, utterance.language, utterance.topic
        parameters = {"text": text, "language": language, "topic": topic}
        number = self._records.request(requester.holder, "speech.start", parameters, now_s)
        self._current = Goal(requester, number, now_s, _SpeechGoal(utterance), topic)

    def start(self, connected: Collection[str], now_s: float) -> None:
        """Send a recorded text that was not cancelled, if its topic is among the `connected` topics."""
        goal = self._recorded(now_s)
        if goal is not None and goal.topic in connected:
            tells = self._voice.say(goal.sent(now_s), goal.what.utterance)
            if not tells:
                self._sent[goal.topic] = now_s
                self._end("sent", "", now_s)

    def close(self, refusal: Refusal, now_s: float) -> None:
        """End the task: the bridge ends. The robot may continue to speak, but nobody observes it."""
        self.deny(refusal, now_s)
        self._end("unheard", "The bridge ended while the robot spoke.", now_s)

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
            goal.heard_s = now_s
            saying = goal.what
            saying.word = find_spoken_word(saying.utterance.text, said, saying.word[1] if saying.word else 0)

    def _report_end(self, goal: Goal[_SpeechGoal], outcome: str, text: str) -> None:
        self.last = wire.SpeechEnd(goal.number.result(), outcome, text)

    def _record(self, goal: Goal[_SpeechGoal], outcome: str, text: str, now_s: float) -> None:
        figures: Parameters = {"text": text, "duration_s": round(now_s - goal.since_s, 2)}
        self._records.outcome(goal, "speech.end", outcome, figures, now_s)


def _short(text: str) -> str:
    """Shorten a text to fit into a sentence.

    Isolate its direction of writing, for example of Arabic in an English sentence.
    """
    one_line = " ".join(text.split())
    return f"\u2068{one_line if len(one_line) <= 60 else f'{one_line[:59]}…'}\u2069"
