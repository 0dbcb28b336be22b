"""Texts that a robot can speak: the bridge refuses others, and the registry keeps no phrase that it would refuse."""

from __future__ import annotations

import unicodedata

from robots.shared.sentences import say
from robots.shared.wire import Refusal

LONGEST_CHARACTERS = 500
_LAYOUT = frozenset("\n\t")


def why_not_speakable(text: str) -> Refusal | None:
    """Return why a robot cannot speak this text; None if it can."""
    for position, character in enumerate(text):
        if character not in _LAYOUT and unicodedata.category(character) in {"Cc", "Cs"}:
            reason = say(
                "Character {position} (U+{code}) cannot be spoken: delete it.",
                position=position + 1,
                code=f"{ord(character):04X}",
            )
            return Refusal("control_characters", reason, "robot", {"position": position})
    if not any(character.isprintable() and not character.isspace() for character in text):
        return Refusal("empty_text", "The text is empty: write a text first.", "robot")
    if len(text) > LONGEST_CHARACTERS:
        figures = {"length": len(text), "limit": LONGEST_CHARACTERS}
        reason = say("The text has {length} characters; the limit is {limit}.", **figures)
        return Refusal("text_too_long", reason, "robot", figures)
    return None
