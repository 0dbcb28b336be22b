"""Takes the names of people out of what the chain says: a file goes from hand to hand, and outlives accounts.

Who had control, watched or pressed stop is in the log and in the recording's row, where a person can be erased.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import msgspec

SOMEBODY = "…"  # stands for a name, in every language
MOST_NAMES = 500
_NAMED = frozenset({"by", "holder", "who", "watchers"})  # fields with names
_TEXTS = frozenset({"ending", "navigation_held", "problem", "reason", "text"})  # that may contain a name


class Nameless:
    """The chain's messages without names. A name that it has met is taken out of later texts, too."""

    def __init__(self) -> None:
        self._names: set[str] = set()
        self._pattern: re.Pattern[str] | None = None

    def __call__(self, data: bytes) -> bytes:
        """Return a message (JSON) without names. Raises msgspec.DecodeError."""
        message = msgspec.json.decode(data)
        found = {name for name in _names_in(message) if isinstance(name, str)} - {"", SOMEBODY}
        if found - self._names:
            self._names = found if len(self._names) > MOST_NAMES else self._names | found
            longest_first = sorted(map(re.escape, self._names), key=len, reverse=True)
            self._pattern = re.compile(rf"(?<!\w)(?:{'|'.join(longest_first)})(?!\w)")
        return msgspec.json.encode(self._without(message))

    def _without(self, value: Any, is_text: bool = False) -> Any:
        match value:
            case str() if is_text and self._pattern is not None:
                return self._pattern.sub(SOMEBODY, value)
            case dict():
                return {
                    key: _hidden(one) if key in _NAMED else self._without(one, is_text or key in _TEXTS)
                    for key, one in value.items()
                }
            case [dict() | list() | str(), *_]:  # a list of numbers, such as a scan, has no name
                return [self._without(one, is_text) for one in value]
        return value


def _names_in(value: Any) -> Iterator[str]:
    match value:
        case dict():
            for key, one in value.items():
                if key not in _NAMED:
                    yield from _names_in(one)
                elif one:
                    yield from one if isinstance(one, list) else (one,)
        case [dict() | list() | str(), *_]:
            for one in value:
                yield from _names_in(one)


def _hidden(value: Any) -> Any:
    if isinstance(value, list):
        return [SOMEBODY] * len(value)
    return SOMEBODY if value else value
