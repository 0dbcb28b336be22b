"""Why JSON does not fit, as sentences: libraries say it in English only, with the names of Python's types."""

from __future__ import annotations

import re
from json import JSONDecodeError

from msgspec import ValidationError

from robots.shared.sentences import Sentence, catalogued, joined, reason_of, say

_PLACE = re.compile(r"(?P<what>.*?)(?: - at `(?:key in )?\$(?P<path>.*)`)?", re.DOTALL)
_KIND = r"Expected `(?P<expected>[^`]*)`"
# Messages of msgspec, each with its sentence; the limit is Python's, for the digits of a number
_MESSAGES = {
    _KIND: catalogued("Expected {expected}"),
    rf"{_KIND}, got `(?P<got>[^`]*)`": catalogued("Expected {expected}, got {got}"),
    rf"{_KIND} (?P<bound>[<>].*)": catalogued("Expected {expected} {bound}"),
    rf"{_KIND} of length (?P<count>[^,]+)": catalogued("Expected {expected} of length {count}"),
    rf"{_KIND} of length (?P<count>[^,]+), got (?P<number>\d+)": catalogued(
        "Expected {expected} of length {count}, got {number}"
    ),
    rf"{_KIND} matching regex '(?P<pattern>.*)'": catalogued("Expected {expected} of the form {pattern}"),
    rf"{_KIND} with a timezone component": catalogued("Expected {expected} with a time zone"),
    r"Invalid RFC3339 encoded (?P<expected>date|datetime)": catalogued("Expected {expected} as in RFC 3339"),
    r"Invalid (?:enum )?value (?P<value>.*)": catalogued("Invalid value {value}"),
    r"Invalid UUID": catalogued("Invalid UUID"),
    r"(?:Integer value|Number|Timestamp) (?:is )?out of range ?|Exceeds the limit .*": catalogued(
        "Number out of range"
    ),
    r"Object missing required field `(?P<field>.*)`": catalogued("Object missing required field {field}"),
    r"Object contains unknown field `(?P<field>.*)`": catalogued("Object contains unknown field {field}"),
    r"Input data was truncated": catalogued("it ends too early"),
    r"JSON is malformed: .* \(byte (?P<byte>\d+)\)": catalogued("it is wrong from byte {byte} on"),
}
_WORDS = {
    "float": say("a number"),
    "int": say("a whole number"),
    "str": say("text"),
    "bool": say("true or false"),
    "array": say("a list"),
    "object": say("an object"),
    "date": say("a day"),
    "datetime": say("a time"),
}


def misfit_of(error: Exception) -> str:
    """Return why JSON could not be decoded, beginning with the place: "scans[0].pose: Expected a list, got text"."""
    if isinstance(error, RecursionError):
        return say("it has too many levels")
    if isinstance(error, UnicodeError):
        return say("it is not UTF-8")
    if isinstance(error, JSONDecodeError):
        return say("it is wrong from line {line}, column {column} on", line=error.lineno, column=error.colno)
    match = _PLACE.fullmatch(str(error))
    what, path = (match["what"], match["path"]) if match else (str(error), None)
    own = error.__cause__ if isinstance(error, ValidationError) else None
    said = reason_of(own) if own else _said(what)
    place = (path or "").removeprefix(".")
    return joined(": ", [place, said]) if place else said


def _said(what: str) -> str:
    plain = what.replace("of at least length ", "of length >= ").replace(
        "of at most length ", "of length <= "
    )
    for pattern, key in _MESSAGES.items():
        if found := re.fullmatch(pattern, plain, re.DOTALL):
            groups = found.groupdict()
            kinds = {name: _kind(groups[name]) for name in ("expected", "got") if name in groups}
            return say(key, **groups | kinds)
    return what


def _kind(name: str) -> Sentence:
    """Return a kind of JSON value in words, such as "a number | null"."""
    return joined(" | ", [_WORDS.get(one, one) for one in name.split(" | ")])
