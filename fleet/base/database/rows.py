"""Run hand-written SQL, and convert its values between Python and SQLite or PostgreSQL.

Queries that run many times a second are written by hand: building a query takes Django far longer than
answering it takes the database.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from datetime import UTC, date, datetime
from functools import cache
from typing import Any, TypeVar
from uuid import UUID

from django.db import OperationalError, connection
from django.db.models import Model

M = TypeVar("M", bound=Model)


def marks(values: Collection[object]) -> str:
    """Return placeholders for these values, for `IN (...)`."""
    return ", ".join(["%s"] * len(values))


def read(query: str, values: Sequence[object]) -> list[tuple[Any, ...]]:
    """Return the rows of a query. `values` are for its placeholders; they may be UUIDs, moments and dates."""
    with connection.cursor() as cursor:
        cursor.execute(query, [_stored(value) for value in values])
        found: list[tuple[Any, ...]] = cursor.fetchall()
    return found


def write_all(query: str, several: Sequence[Sequence[object]]) -> None:
    """Run a query that writes, once for each of these rows of values."""
    if several:
        with connection.cursor() as cursor:
            cursor.executemany(query, [[_stored(value) for value in values] for values in several])


def models(kind: type[M], query: str, values: Sequence[object]) -> list[M]:
    """Return models for the rows of a query.

    It selects all columns of the model; others become attributes.
    """
    with connection.cursor() as cursor:
        cursor.execute(query, [_stored(value) for value in values])
        build = _builder(kind, tuple(column[0] for column in cursor.description))
        return [build(row) for row in cursor.fetchall()]


def key(stored: UUID | str) -> UUID:
    """Return a key, as a query returned it, as a UUID."""
    return stored if isinstance(stored, UUID) else UUID(hex=stored)


def moment(stored: datetime | str) -> datetime:
    """Return a moment, as a query returned it, as a datetime with zone.

    SQLite's driver returns a datetime for some columns and a text for others, without a zone.
    """
    found = datetime.fromisoformat(stored) if isinstance(stored, str) else stored
    return found if found.tzinfo else found.replace(tzinfo=UTC)


def _stored(value: object) -> Any:
    if isinstance(value, UUID):
        return value if _stores_keys() else value.hex
    if isinstance(value, datetime):
        return connection.ops.adapt_datetimefield_value(value)
    return connection.ops.adapt_datefield_value(value) if isinstance(value, date) else value


@cache
def _stores_keys() -> bool:
    return connection.features.has_native_uuid_field


@cache
def _builder(kind: type[M], columns: tuple[str, ...]) -> Callable[[Sequence[Any]], M]:
    """Return a function that makes a model from a row.

    Django's raw queries look up fields and converters each time, which takes 0.3 ms.
    """
    fields = kind._meta.concrete_fields
    names = [field.attname for field in fields]
    parts = []
    for field in fields:
        if field.column not in columns:
            raise OperationalError(
                f"{kind._meta.db_table} has no column {field.column}: run manage.py migrate"
            )
        column = field.get_col(kind._meta.db_table)
        converters = [*connection.ops.get_db_converters(column), *column.get_db_converters(connection)]
        parts.append((columns.index(field.column), column, converters))
    further = [
        (place, name) for place, name in enumerate(columns) if place not in {part[0] for part in parts}
    ]

    def build(row: Sequence[Any]) -> M:
        values = []
        for place, column, converters in parts:
            value = row[place]
            for convert in converters:
                value = convert(value, column, connection)
            values.append(value)
        found = kind.from_db(connection.alias, names, values)
        for place, name in further:
            setattr(found, name, row[place])
        return found

    return build
