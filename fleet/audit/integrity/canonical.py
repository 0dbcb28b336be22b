"""The bytes of a record from which its digest is computed: always the same, with every database.

SQLite returns JSON as it was written. PostgreSQL's jsonb changes some numbers and cannot store some
characters. So values are made plain before they are written (`plain`): both databases return plain values
unchanged.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any, Protocol
from uuid import UUID

from fleet.audit.errors import NotPlain

NO_ROBOT = UUID(int=0)  # the chain of records without robot
TEXT_BYTES = 4096  # longest text in a record, in UTF-8

_UNSTORABLE = re.compile("[\0\ud800-\udfff]")  # PostgreSQL stores no NUL, and UTF-8 no single surrogate
_REPLACEMENT = "\ufffd"


class Chained(Protocol):
    """The columns of a record that enter the chain."""

    id: int
    at: datetime
    day: Any
    kind: str
    actor_id: str | None
    real_actor_id: str | None
    robot_id: UUID | None
    robot_name: str
    session_id: UUID | None
    fence: int | None
    request_id: UUID
    of_id: int | None
    outcome: str
    parameters: dict[str, Any]
    content_digest: str
    seq: int


# --- values -----------------------------------------------------------------------------------------


def plain_text(text: str) -> str:
    """Return `text` with U+FFFD in place of characters that a database cannot store."""
    return _UNSTORABLE.sub(_REPLACEMENT, text)


def bounded_text(text: str) -> str:
    """Return `plain_text`, cut to `TEXT_BYTES`; a text that is cut ends with its former length."""
    whole = plain_text(text)
    size = len(whole.encode())
    if size <= TEXT_BYTES:
        return whole
    rest = f"… [cut: {size} bytes]"
    return whole.encode()[: TEXT_BYTES - len(rest.encode())].decode(errors="ignore") + rest


def plain(value: Any, as_text: Callable[[str], str] = plain_text) -> Any:
    """Return `value` as both databases return it: whole numbers are integers, text is valid text.

    `as_text` is applied to each text in it. Raises `NotPlain` for values that are no JSON: infinities, NaN,
    objects, keys that are no text.
    """
    match value:
        case None | bool():
            return value
        case str():
            return as_text(value)
        case int():
            return int(value)
        case float():
            return _plain_number(value)
        case Mapping():
            return {_plain_key(key): plain(item, as_text) for key, item in value.items()}
        case list() | tuple():
            return [plain(item, as_text) for item in value]
    raise NotPlain(value)


def _plain_number(number: float) -> float | int:
    if not math.isfinite(number):
        raise NotPlain(number)
    return int(number) if number.is_integer() else number


def _plain_key(key: Any) -> str:
    if not isinstance(key, str):
        raise NotPlain(key)
    return plain_text(key)


def canonical(value: Any) -> bytes:
    """Return a plain value as bytes: JSON with sorted keys, without spaces, in UTF-8."""
    return json.dumps(
        value, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(",", ":")
    ).encode()


# --- digests ----------------------------------------------------------------------------------------


def first_digest(chain: UUID) -> str:
    """Return the digest before the first record of a chain, in hex."""
    return hashlib.sha256(b"fleet audit" + chain.bytes).hexdigest()


def next_digest(previous: str, record: Chained) -> str:
    """Return the digest of a record. `previous` is the digest of the record before it; both in hex."""
    return hashlib.sha256(bytes.fromhex(previous) + _of(record)).hexdigest()


def content_digest(salt: str, text: str, data: dict[str, Any]) -> str:
    """Return the digest of content that may expire; the chain keeps it.

    The salt (hex) stops guesses of short texts.
    """
    return hashlib.sha256(bytes.fromhex(salt) + canonical([text, data])).hexdigest()


def _of(record: Chained) -> bytes:
    return canonical(
        [
            record.id,
            record.at.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
            record.day.isoformat(),
            record.kind,
            record.actor_id,
            record.real_actor_id,
            _hex(record.robot_id),
            record.robot_name,
            _hex(record.session_id),
            record.fence,
            _hex(record.request_id),
            record.of_id,
            record.outcome,
            record.parameters,
            record.content_digest,
            record.seq,
        ]
    )


def _hex(identifier: UUID | None) -> str | None:
    return None if identifier is None else identifier.hex
