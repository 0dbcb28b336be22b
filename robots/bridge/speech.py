"""One text at a time for the robot's voice: which texts can be said, and what becomes of the one that is said."""

from __future__ import annotations

import unicodedata

from robots.wire import Refusal

LONGEST_CHARACTERS = 500
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
