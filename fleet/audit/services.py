"""Write to the audit log.

A record is appended to the chain of its robot, or to the chain without robot. The writer locks the chain
until the commit: on PostgreSQL by a lock on the chain's row, on SQLite as the only writer. So a chain never
gets two records at one place.
"""

from __future__ import annotations

import secrets
import unicodedata
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

from django.contrib.auth.models import AbstractUser
from django.db import InterfaceError, InternalError, OperationalError, connection, transaction
from django.utils import timezone

from fleet.audit.command_line import SystemAccount
from fleet.audit.errors import AuditUnavailable, UnknownKind
from fleet.audit.integrity.canonical import (
    NO_ROBOT,
    bounded_text,
    content_digest,
    first_digest,
    next_digest,
    plain,
    plain_text,
)
from fleet.audit.kinds import KINDS
from fleet.audit.models import Actor, Chain, Content, Record
from fleet.audit.rates import require_rate
from robots.shared.sentences import Sentence

NAME_LENGTH = 200  # characters of a name or an outcome; the rest is cut off
SALT_BYTES = 16
BATCH = 500  # rows in one statement


def record(
    kind: str,
    *,
    actor: AbstractUser | SystemAccount | None = None,
    real_actor: AbstractUser | SystemAccount | None = None,
    robot_id: uuid.UUID | None = None,
    robot_name: str = "",
    session_id: uuid.UUID | None = None,
    fence: int | None = None,
    request_id: uuid.UUID | None = None,
    of: Record | int | None = None,
    outcome: str = "",
    parameters: dict[str, Any] | None = None,
    text: str = "",
    private: dict[str, Any] | None = None,
) -> Record:
    """Append one record. It is committed on return, or with the transaction around the call.

    `kind` is one of `fleet.audit.kinds`. `actor` None means the console itself; `real_actor` is the person who really
    did it, if that is somebody else. `session_id` is the control session, `fence` the fence of its lease. `of` is
    the earlier record whose outcome this is; robot, session, fence and request are copied from it unless given.

    `parameters` are kept as long as the record: plain facts, people by their identifier, no free text. `text`
    is what a person wrote or a robot said; it can be searched. `private` has other details. `text` and
    `private` expire, and are removed when a person is erased. A text of more than 4 KiB is cut, and its
    length is noted.

    Raises `AuditUnavailable` when the database cannot be written, or `TooManyChanges` when the actor has made too
    many changes (`rates`): then the caller must not do the action. Raises `ValueError` for an unknown kind or a
    value that is no JSON. Of a sentence (`text`, or `words` in `private`), `said` keeps key and figures.
    """
    people = {_id_of(person): person for person in (actor, real_actor) if person is not None}
    new = _new(
        kind,
        RecordBody(parameters or {}, text, private or {}),
        actor_id=_id_of(actor) if actor else None,
        real_actor_id=_id_of(real_actor) if real_actor else None,
        robot_id=robot_id,
        robot_name=_short(robot_name),
        session_id=session_id,
        fence=fence,
        outcome=_short(outcome),
    )
    with _as_audit_unavailable(), transaction.atomic(savepoint=False):
        if of is None:  # an outcome is recorded always
            require_rate(kind, actor, timezone.now())
        _copy_from_request(new[0], _numbered(of) if isinstance(of, int) else of, request_id)
        _append([new], people)
    return new[0]


class RecordBody(NamedTuple):
    """The content of one record: the arguments of `record`."""

    parameters: dict[str, Any]
    text: str = ""
    private: dict[str, Any] = {}
    outcome: str = ""


def record_all(
    kind: str,
    several: Sequence[RecordBody],
    *,
    actor: AbstractUser | SystemAccount | None,
    robot_id: uuid.UUID | None = None,
    robot_name: str = "",
) -> None:
    """Append records of one kind, one actor and one robot, or without robot, in this order.

    Raises the same errors as `record`.
    """
    people = {_id_of(actor): actor} if actor else {}
    common = {
        "actor_id": _id_of(actor) if actor else None,
        "robot_id": robot_id,
        "robot_name": _short(robot_name),
    }
    new = [_new(kind, body, outcome=_short(body.outcome), **common) for body in several]
    for record_, _ in new:
        _copy_from_request(record_, None, None)
    with _as_audit_unavailable(), transaction.atomic(savepoint=False):
        require_rate(kind, actor, timezone.now(), len(new))
        _append(new, people)


def actor_renamed(person: AbstractUser) -> None:
    """Show a person's records under the current name, unless the person is erased.

    Raises `AuditUnavailable`.
    """
    with _as_audit_unavailable():
        Actor.objects.filter(pk=_id_of(person), erased_at=None).update(name=_name(person))


def lock_chain(chain_id: uuid.UUID, name: str = "") -> None:
    """Lock a chain until the commit; make it if it is new.

    A chain is shown under the last `name` that was given.
    """
    known = _lock(chain_id)
    if known is None:
        Chain.objects.bulk_create([Chain(id=chain_id, name=name)], ignore_conflicts=True)
        known = _lock(chain_id)
    if name and name != known:
        Chain.objects.filter(pk=chain_id).update(name=name)


def wait_for_writers() -> None:
    """Wait until all writers have committed, chain by chain: a writer gets record numbers only with the lock.

    This does not wait for the first record of a robot: nobody else can lock its chain before the commit.
    """
    for chain_id in list(Chain.objects.values_list("pk", flat=True)):
        with _as_audit_unavailable(), transaction.atomic():
            _lock(chain_id)


def _copy_from_request(new: Record, earlier: Record | None, request_id: uuid.UUID | None) -> None:
    """Copy the fields that are not given from the request of this outcome."""
    if earlier is not None:
        new.of = earlier
        new.robot_id = new.robot_id or earlier.robot_id
        new.robot_name = new.robot_name or earlier.robot_name
        new.session_id = new.session_id or earlier.session_id
        new.fence = earlier.fence if new.fence is None else new.fence
        request_id = request_id or earlier.request_id
    new.request_id = request_id or uuid.uuid4()


def _numbered(number: int) -> Record:
    found = Record.objects.filter(pk=number).first()
    if found is None:
        raise ValueError(f"there is no record {number} whose outcome this could be")
    return found


_New = tuple[Record, Content | None]


def _new(kind: str, body: RecordBody, **fields: Any) -> _New:
    """Return a record, which has no place yet, and its content. Raises `UnknownKind` or `ValueError`."""
    if kind not in KINDS:
        raise UnknownKind(kind)
    new = Record(kind=kind, parameters=plain(body.parameters, bounded_text), **fields)
    content = _content(body.text, body.private)
    if content is not None:
        new.content_digest = content_digest(content.salt, content.text, content.data)
    return new, content


def _append(new: Sequence[_New], people: dict[str, AbstractUser | SystemAccount]) -> None:
    """Give these records of one chain their places in it, and insert them.

    Numbers grow with the places. Times grow, too, unless somebody sets the clock back.
    """
    if not new:
        return
    robot_id = new[0][0].robot_id
    chain_id = robot_id or NO_ROBOT
    lock_chain(chain_id, new[0][0].robot_name)
    _ensure_actors(people)
    last = Record.objects.filter(robot_id=robot_id).order_by("-seq").values_list("seq", "digest").first()
    seq, digest = last or (0, first_digest(chain_id))
    for (one, _), number in zip(new, _next_numbers(len(new)), strict=True):
        one.id = number
        one.at = timezone.now()
        one.day = one.at.date()
        one.seq = seq = seq + 1
        one.digest = digest = next_digest(digest, one)
    Record.objects.bulk_create([one for one, _ in new], batch_size=BATCH)
    contents = [content for _, content in new if content is not None]
    for one, content in new:
        if content is not None:
            content.record = one
    Content.objects.bulk_create(contents, batch_size=BATCH)


def _lock(chain_id: uuid.UUID) -> str | None:
    """Lock a chain until the commit and return its name; None: there is no such chain yet."""
    return Chain.objects.select_for_update().filter(pk=chain_id).values_list("name", flat=True).first()


def _ensure_actors(people: dict[str, AbstractUser | SystemAccount]) -> None:
    """Ensure that each actor has a row; an existing row keeps its name."""
    if not people:
        return
    known = set(Actor.objects.filter(pk__in=people).values_list("pk", flat=True))
    new = [Actor(id=key, name=_name(person)) for key, person in people.items() if key not in known]
    if new:
        Actor.objects.bulk_create(new, ignore_conflicts=True)


def _next_numbers(count: int) -> list[int]:
    """Return the next order numbers, ascending. On SQLite nobody else writes until the commit."""
    with connection.cursor() as cursor:
        if connection.vendor == "sqlite":
            cursor.execute("SELECT COALESCE(MAX(id), 0) + 1 FROM audit_record")
            first: int = cursor.fetchone()[0]
            return list(range(first, first + count))
        cursor.execute(
            "SELECT nextval(pg_get_serial_sequence('audit_record', 'id')) FROM generate_series(1, %s)",
            [count],
        )
        return sorted(number for (number,) in cursor.fetchall())


def _content(text: str, private: dict[str, Any]) -> Content | None:
    if not text and not private:
        return None
    # normalised to NFC, like search words
    kept = bounded_text(unicodedata.normalize("NFC", text))
    told = [one for one in (text, private.get("words")) if isinstance(one, Sentence) and one.figures]
    data = plain({**private, "said": told[0].parts} if told else private, bounded_text)
    return Content(text=kept, data=data, salt=secrets.token_hex(SALT_BYTES))


def _id_of(person: AbstractUser | SystemAccount) -> str:
    if isinstance(person, SystemAccount):
        return f"system:{_short(person.name)}"[:64]
    return str(person.pk)


def _name(person: AbstractUser | SystemAccount) -> str:
    if isinstance(person, SystemAccount):
        return _short(person.name)
    return _short(person.get_full_name() or person.get_username())


def _short(name: str) -> str:
    return plain_text(name)[:NAME_LENGTH]


@contextmanager
def _as_audit_unavailable() -> Iterator[None]:
    try:
        yield
    except (OperationalError, InternalError, InterfaceError) as error:
        raise AuditUnavailable.because(error) from error
