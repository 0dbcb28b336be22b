"""One text at a time for the robot's voice: which texts can be said, and what becomes of the one that is said.

A text is on record before it is sent. It is said to its end also when its holder goes; only a cancel and the emergency
stop end it, by its goal's id.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Protocol
from uuid import uuid4

from msgspec import Struct

from robots import wire
from robots.bridge.drives import Answer, DriveLog, not_recorded
from robots.bridge.sink import Holder, Parameters
from robots.wire import Refusal

LONGEST_CHARACTERS = 500
UNHEARD_S = 2.0  # a text of which the robot has not spoken for this long is given up
CANCEL_AGAIN_S = 0.5  # a cancel that the robot does not obey may not have reached it
_LAYOUT = frozenset("\n\t")


def why_not_speakable(text: str) -> Refusal | None:
    """Why a robot should not be asked to say this; None if it may be."""
    for position, character in enumerate(text):
        if character not in _LAYOUT and unicodedata.category(character) in {"Cc", "Cs"}:
            told = f"Character {position + 1} (U+{ord(character):04X}) cannot be spoken: delete it."
            return Refusal("control_characters", told, "robot", {"position": position})
    if not any(character.isprintable() and not character.isspace() for character in text):
        return Refusal("empty_text", "There is nothing to say: write a text first.", "robot")
    if len(text) > LONGEST_CHARACTERS:
        told = f"The text has {len(text)} characters; at most {LONGEST_CHARACTERS} are said at once."
        figures: dict[str, float | int | str | None] = {"length": len(text), "limit": LONGEST_CHARACTERS}
        return Refusal("text_too_long", told, "robot", figures)
    return None


def own_language(asked: str, own: Sequence[str]) -> str:
    """What the robot itself calls a language (BCP 47), if it is one of its `own`; else as it was asked for.

    The same tag, in whichever case; else the first that is the same language: voices know es-ES, and neither es nor
    es-MX.
    """
    same = [tag for tag in own if tag.lower() == asked.lower()]
    akin = [tag for tag in own if _primary(tag) == _primary(asked)]
    return next(iter(same + akin), asked)


def _primary(tag: str) -> str:
    return tag.lower().partition("-")[0]


def word_said(text: str, said: str, after: int = 0) -> tuple[int, int] | None:
    """Where in `text` the last word of `said` stands: its first and its last + 1 character.

    Some robots tell all that was said so far, some only the newest word, which is then looked for from `after` on.
    """
    told = said.split()
    if not told:
        return None
    words = list(re.finditer(r"\S+", text))
    if [word.group() for word in words[: len(told)]] == told and not (after and len(told) == 1):
        return words[len(told) - 1].span()
    found = text.find(told[-1], after)
    return (found, found + len(told[-1])) if found >= 0 else None


class Utterance(Struct, frozen=True):
    """What is to be said where: `topic` is an action's name if the robot's voice is an action."""

    text: str
    language: str
    topic: str


class Voice(Protocol):
    """What speaks."""

    def say(self, goal_id: str, utterance: Utterance) -> bool:
        """Pass it on. Whether the robot tells what becomes of it."""

    def hush(self, goal_id: str, topic: str) -> None:
        """Cancel this goal and no other."""


@dataclass
class _Saying:
    """A text that was asked for; it has a goal once it is on record."""

    utterance: Utterance
    holder: Holder
    since_s: float
    number: Future[int]
    answer: Answer
    goal_id: str | None = None
    status: str = "sent"
    word: tuple[int, int] | None = None
    heard_s: float = math.inf
    cancelled: tuple[str, str] | None = None  # outcome, and why in words
    hush_again_s: float | None = None


class Speaking:
    """The text that is being said, if any: this console's, or somebody else's, of which only goal ids are known."""

    def __init__(self, voice: Voice, log: DriveLog) -> None:
        self._voice = voice
        self._log = log
        self._saying: _Saying | None = None
        self._last: wire.SpeechEnd | None = None
        self._ended: str | None = None  # the last one's goal, of which an older word may still come
        self._others: dict[str, float] = {}  # topics on which others have the robot say something: told last

    def refuse(self, now_s: float) -> Refusal | None:
        """Why nothing else can be said: the robot speaks."""
        saying = self._saying
        if saying is not None:
            who, text = saying.holder.holder, saying.utterance.text
            told = f"The robot says “{_short(text)}”, asked for by {who}: cancel that, or wait."
            return Refusal("speaking", told, "robot", {"who": who, "text": text})
        if any(now_s - told_s <= UNHEARD_S for told_s in self._others.values()):
            return Refusal("speaking", "The robot says something that others asked for: wait.", "robot")
        return None

    def begin(self, utterance: Utterance, holder: Holder, now_s: float, answer: Answer) -> None:
        """Put it on record; it is sent, and the question answered, once that is done."""
        text, language, topic = utterance.text, utterance.language, utterance.topic
        parameters = {"text": text, "language": language, "topic": topic}
        number = self._log.request(holder, "speech.start", parameters, now_s)
        self._saying = _Saying(utterance, holder, now_s, number, answer)

    @property
    def topic(self) -> str | None:
        """Where this console's text is said."""
        return self._saying.utterance.topic if self._saying else None

    @property
    def waiting(self) -> bool:
        """Whether a text was asked for that has not been sent yet."""
        return self._saying is not None and self._saying.goal_id is None

    def cancel(self, outcome: str, why: str) -> bool:
        """Cancel this console's text by its goal's id. Whether there was one."""
        saying = self._saying
        if saying is None:
            return False
        if saying.cancelled is None:
            saying.cancelled = (outcome, why)
            if saying.goal_id is not None:
                self._voice.hush(saying.goal_id, saying.utterance.topic)
        return True

    def tick(self, connected: Collection[str], now_s: float) -> None:
        """Send what is on record now, if its topic is one of the `connected`; repeat a cancel until the robot obeys.

        What the robot is silent on is given up.
        """
        saying = self._saying
        if saying is None:
            return
        if saying.goal_id is None and saying.number.done():
            self._recorded(saying, connected, now_s)
        if now_s - saying.heard_s > UNHEARD_S and self._saying is saying:
            self.cancel("unheard", f"The robot did not speak of it for {UNHEARD_S:.0f} s.")
            self._end("cancelled", "", now_s)
        elif saying.cancelled is not None and saying.goal_id is not None:
            if saying.hush_again_s is None:
                saying.hush_again_s = now_s + CANCEL_AGAIN_S
            elif now_s >= saying.hush_again_s:
                saying.hush_again_s = now_s + CANCEL_AGAIN_S
                self._voice.hush(saying.goal_id, saying.utterance.topic)

    def close(self, now_s: float) -> None:
        """The bridge ends: the robot may go on, unheard from here."""
        if self._saying and self._saying.goal_id:
            self._end("unheard", "The bridge ended while the robot spoke.", now_s)

    def view(self, now_s: float) -> wire.Speech | None:
        """What is being said, for pages, from when it was sent."""
        saying = self._saying
        if saying is None or saying.goal_id is None:
            return None
        return wire.Speech(
            number=saying.number.result(),
            text=saying.utterance.text,
            language=saying.utterance.language,
            topic=saying.utterance.topic,
            who=saying.holder.holder,
            status=saying.status,
            since_s=round(now_s - saying.since_s, 1),
            word=saying.word,
        )

    @property
    def last(self) -> wire.SpeechEnd | None:
        """How the last one ended, for pages."""
        return self._last

    # --- what the robot says of it --------------------------------------------------------------------

    def running(self, topic: str, goals: Mapping[str, str], now_s: float) -> None:
        """Which goals are under way on a topic, and how each is: accepted or speaking."""
        saying = self._saying
        if goals.keys() - {saying.goal_id if saying else None, self._ended}:
            self._others[topic] = now_s
        else:
            self._others.pop(topic, None)
        if saying is not None and saying.goal_id is not None and saying.goal_id in goals:
            saying.status, saying.heard_s = goals[saying.goal_id], now_s

    def said(self, goal_id: str, said: str, now_s: float) -> None:
        """A word was begun: `said` ends with it."""
        saying = self._saying
        if saying is not None and saying.goal_id == goal_id:
            saying.heard_s = now_s
            saying.word = word_said(saying.utterance.text, said, saying.word[1] if saying.word else 0)

    def ended(self, goal_id: str, outcome: str, text: str, now_s: float) -> None:
        """A goal has ended."""
        if self._saying is not None and self._saying.goal_id == goal_id:
            self._end(outcome, text, now_s)

    # --- inside -----------------------------------------------------------------------------------------

    def _recorded(self, saying: _Saying, connected: Collection[str], now_s: float) -> None:
        """What could not be recorded, or was cancelled meanwhile, is not said."""
        error = saying.number.exception()
        if error is not None:
            self._saying = None
            saying.answer(not_recorded(error))
            return
        if math.isinf(saying.heard_s):
            saying.heard_s = now_s
            saying.answer(None)
        if saying.cancelled is not None:
            self._end("cancelled", "", now_s)
        elif saying.utterance.topic in connected:
            saying.goal_id, saying.heard_s = f"fleet_bridge-{uuid4()}", now_s
            if not self._voice.say(saying.goal_id, saying.utterance):
                self._end("sent", "", now_s)

    def _end(self, outcome: str, text: str, now_s: float) -> None:
        """What ended as cancelled ended for the reason for which it was cancelled here, if it was."""
        saying, self._saying = self._saying, None
        if saying is not None:
            self._ended = saying.goal_id
            if outcome == "cancelled" and saying.cancelled is not None:
                outcome, text = saying.cancelled
            number = saying.number.result()
            self._last = wire.SpeechEnd(number, outcome, text)
            figures: Parameters = {"text": text, "duration_s": round(now_s - saying.since_s, 2)}
            self._log.outcome(saying.number, saying.holder, "speech.end", outcome, figures, now_s)


def _short(text: str) -> str:
    """As much of it as a sentence about it can carry."""
    one_line = " ".join(text.split())
    return one_line if len(one_line) <= 60 else f"{one_line[:59]}…"
