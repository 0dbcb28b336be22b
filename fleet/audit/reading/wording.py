"""Texts about records: the action and its values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Any

from django.utils.translation import gettext as _

from fleet.audit.kinds import KINDS
from fleet.audit.models import Record
from fleet.audit.reading.words import CODED, WORDS
from fleet.base.formats.dates import dated
from fleet.base.formats.sentences import in_words, localised
from fleet.base.zones import viewers
from robots.shared.sentences import of_parts

FACTS = 4  # values at most in a line of a list
LONG = 60  # characters at most of a text in such a line; also entries at most of a list on the record's page

# Endings of parameter names, and their units.
_UNITS = {
    "_mps2": "m/s²",
    "_radps": "rad/s",
    "_mps": "m/s",
    "_deg": "°",
    "_rad": "rad",
    "_hz": "Hz",
    "_m": "m",
    "_s": "s",
}
_IDENTIFIER = re.compile(r"[0-9a-f]{8}-?([0-9a-f]{4}-?){3}[0-9a-f]{12}|[0-9a-f]{32,}")  # not shown in a line
_MOMENT = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{6})?\+00:00")
# The subject of a record is the first of these fields that it has.
_SUBJECTS = (
    "text",
    "words",
    "motion",
    "topic",
    "service",
    "camera",
    "name",
    "username",
    "entry",
    "profile",
    "file",
)
_ASIDE = {"t_s", "number", "path_tolerance_m", "progress"}  # shown only on the record's page


def label(kind: str) -> str:
    """Return the label of a kind; for an unknown kind of an older version, the kind itself."""
    return str(KINDS[kind].label) if kind in KINDS else kind


def who(record: Record) -> str:
    """Return the actor's name, with the real actor if that is another person."""
    acted = record.actor_name or _("the console")
    if record.real_actor is None or record.real_actor_id == record.actor_id:
        return acted
    return _("%(real)s as %(actor)s") % {"real": record.real_actor.name, "actor": acted}


def outcome(code: str) -> str:
    """Return the text of an outcome, or of the reason of a refusal: most codes are made of words."""
    return _("cancelled, but not by its holder") if code == "intruder" else in_words(code.replace("_", " "))


def subject(record: Record) -> str:
    """Return the subject: sentence, motion or topic; blank if there is none."""
    details = worded(record.details)
    return next((str(details[name]) for name in _SUBJECTS if isinstance(details.get(name), str)), "")


def worded(details: Mapping[str, Any]) -> dict[str, Any]:
    """Return details with their sentence in the reader's language: a text with key and figures, or `words`."""
    told = {name: value for name, value in details.items() if name != "said"}
    name = "words" if "words" in told else "text"
    said = details.get("said") or ([told["words"]] if "words" in told else [])
    return told | {name: in_words(of_parts(told[name], said))} if said and name in told else told


def expired(record: Record) -> bool:
    """Return whether the record's content has been removed."""
    return bool(record.content_digest) and record.content_kept is None


def facts(records: list[Record]) -> list[str]:
    """Return some values of a request and its outcome, such as "distance 3.2 m"."""
    found: dict[str, str] = {}
    for record in records:
        for name, value in record.details.items():
            if name not in _SUBJECTS and name not in _ASIDE and _is_short(value):
                found[name] = figure(name, value)
    return list(found.values())[:FACTS]


def figure(name: str, value: Any) -> str:
    """Return one value with its name and unit."""
    for ending, unit in _UNITS.items():
        if name.endswith(ending) and isinstance(value, int | float):
            return f"{plain(name.removesuffix(ending))} {localised(value)} {unit}"
    return f"{plain(name)} {said(_coded(name, value))}"


def _coded(name: str, value: Any) -> Any:
    """Return a value of a field with codes in the reader's words."""
    if name not in CODED:
        return value
    codes = value if isinstance(value, list) else [value]
    return [in_words(word) if (word := str(code).replace("_", " ")) in WORDS else code for code in codes]


def _moment(value: Any) -> str:
    """Return a moment, given in UTC, in the reader's zone; blank if the value is no moment."""
    if not isinstance(value, str) or not _MOMENT.fullmatch(value):
        return ""
    return dated(datetime.fromisoformat(value).astimezone(viewers()), "d M Y, H:i")


def lines(details: Mapping[str, Any], within: str = "") -> Iterator[tuple[str, str]]:
    """Return all details as pairs of name and text. Nested names are joined.

    For long lists, only the length.
    """
    for name, value in details.items():
        known_as = f"{within}{plain(name)}"
        match value:
            case Mapping() if value:
                yield from lines(value, within=f"{known_as} · ")
            case list() if len(value) > LONG or any(isinstance(entry, list) for entry in value):
                yield known_as, _("%d entries, all in the export") % len(value)
            case list() if value and all(isinstance(entry, Mapping) for entry in value):
                for number, entry in enumerate(value, 1):
                    yield from lines(entry, within=f"{known_as} {number} · ")
            case int() | float() if not isinstance(value, bool) and (unit := _UNITS.get(_unit_of(name))):
                yield known_as, f"{localised(value)} {unit}"
            case _:
                yield known_as, said(_coded(name, value))


def plain(name: str) -> str:
    """Return a field's name in words, without its unit."""
    return in_words(name.removesuffix(_unit_of(name)).replace("_", " "))


def _unit_of(name: str) -> str:
    """Return the ending of a field's name that tells its unit; empty: none does."""
    return next((ending for ending in _UNITS if name.endswith(ending)), "")


def said(value: Any) -> str:
    match value:
        case True:
            return _("yes")
        case False:
            return _("no")
        case None:
            return _("none")
        case list():
            return ", ".join(said(entry) for entry in value) or _("none")
        case float():
            return localised(value)
    return _moment(value) or str(value)


def _is_short(value: Any) -> bool:
    if isinstance(value, str):
        return 0 < len(value) <= LONG and not _IDENTIFIER.fullmatch(value)
    return isinstance(value, int | float)
