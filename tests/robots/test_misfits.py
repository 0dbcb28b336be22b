"""Why JSON does not fit: with its place, and as sentences of the catalogue."""

from __future__ import annotations

from datetime import date, datetime
from typing import Annotated, Literal
from uuid import UUID

import msgspec
import pytest
from msgspec import Meta, Struct

from robots.shared import wire
from robots.shared.misfits import misfit_of
from robots.shared.sentences import Sentence, say


class Part(Struct, forbid_unknown_fields=True):
    """Types of fields as in messages and bodies."""

    share: Annotated[float, Meta(ge=0.1)] | None = None
    kind: Literal["p", "q"] = "p"
    at: Annotated[datetime, Meta(tz=True)] | None = None
    day: date | None = None
    three: tuple[int, int, int] = (1, 2, 3)
    few: Annotated[list[int], Meta(max_length=2)] = []
    name: Annotated[str, Meta(min_length=2, pattern="^a")] = "ab"
    inner: dict[str, list[UUID]] = {}

    def __post_init__(self) -> None:
        if self.kind == "q":
            raise ValueError(say("the kind {kind} is not built", kind=self.kind))


@pytest.mark.parametrize(
    ("part", "said", "key"),
    [
        ('{"share": "r"}', "share: Expected a number | null, got text", "Expected {expected}, got {got}"),
        ('{"share": 0}', "share: Expected a number >= 0.1", "Expected {expected} {bound}"),
        ('{"kind": "r"}', "kind: Invalid value 'r'", "Invalid value {value}"),
        ('{"at": "now"}', "at: Expected a time as in RFC 3339", "Expected {expected} as in RFC 3339"),
        (
            '{"at": "2026-01-01T10:00:00"}',
            "at: Expected a time with a time zone",
            "Expected {expected} with a time zone",
        ),
        ('{"day": "x"}', "day: Expected a day as in RFC 3339", "Expected {expected} as in RFC 3339"),
        ('{"three": [1]}', "three: Expected a list of length 3", "Expected {expected} of length {count}"),
        (
            '{"few": [1, 2, 3]}',
            "few: Expected a list of length <= 2",
            "Expected {expected} of length {count}",
        ),
        ('{"name": "bb"}', "name: Expected text of the form ^a", "Expected {expected} of the form {pattern}"),
        ('{"inner": {"a": ["x"]}}', "inner[...][0]: Invalid UUID", "Invalid UUID"),
        ('{"kind": "q"}', "the kind q is not built", "the kind {kind} is not built"),
        ('{"more": 1}', "Object contains unknown field more", "Object contains unknown field {field}"),
    ],
)
def test_what_does_not_fit_is_a_sentence_with_its_place(part: str, said: str, key: str) -> None:
    with pytest.raises(msgspec.ValidationError) as raised:
        msgspec.json.decode(f"[{part}]", type=list[Part])
    found = misfit_of(raised.value)
    assert isinstance(found, Sentence)
    assert found == f"[0].{said}" if said[: said.find(":")].isalpha() else f"[0]: {said}"
    assert found.figures["part1"].key == key


@pytest.mark.parametrize(
    ("raw", "figure"),
    [
        (b"{", ["it ends too early"]),
        (b"{]", ["it is wrong from byte {byte} on", {"byte": "1"}]),
        (b'{"t": "\xff"}', ["it is not UTF-8"]),
        (b'{"t": ' + b"[" * 4000, ["it has too many levels"]),
        (b'{"t": "drive_by", "fence": 1}', ["give either distance_m or angle_rad"]),
        (b'{"t": "play"}', ["Object missing required field {field}", {"field": "fence"}]),
    ],
)
def test_a_refused_message_carries_key_and_figures(raw: bytes, figure: list[object]) -> None:
    with pytest.raises(wire.WireError) as raised:
        wire.browser_message(raw)
    said = msgspec.json.decode(wire.encode(raised.value.refusal))["said"]["text"]
    assert said[1] == {"error": figure}
