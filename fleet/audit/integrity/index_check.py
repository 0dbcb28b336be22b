"""Check that the search index agrees with the log: a search must not miss texts.

SQLite: index the texts again in a temporary table, one batch at a time. Each group of three characters must
have the same places as in the index. PostgreSQL maintains its index itself: check that its definition is
unchanged, that it is valid, and that it has as many texts as the table. Both checks only read, and block no
writer.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from django.db import DatabaseError, connection, transaction
from django.db.backends.utils import CursorWrapper

BATCH_SIZE = 5_000  # texts that are indexed at a time

# For each group of characters: the number of its places, and a checksum of places that ignores their order.
_PLACES = (
    "SELECT term, count(*), sum((doc % 1000003 + 7) * (offset % 10007 + 13) % 1000000007 * 31 + doc)"
    " FROM temp.{0} GROUP BY term"
)
_SQLITE = {
    "audit_content_search": "CREATE VIRTUAL TABLE audit_content_search USING fts5( text, content='audit_content',"
    " content_rowid='record_id', tokenize='trigram' )",
    "audit_content_said": "CREATE INDEX audit_content_said ON audit_content (record_id, text) WHERE text <> ''",
}
_POSTGRESQL = {
    "audit_content_trigrams": "CREATE INDEX audit_content_trigrams ON audit_content USING gin (text gin_trgm_ops)",
    "audit_content_said": "CREATE INDEX audit_content_said ON audit_content USING btree (record_id) INCLUDE (text)"
    " WHERE ((text <> ''::text) AND (octet_length(text) <= 2000))",
    "audit_content_said_at_length": "CREATE INDEX audit_content_said_at_length ON audit_content"
    " USING btree (record_id) WHERE (octet_length(text) > 2000)",
}


def disagreements() -> Iterator[str]:
    """Return descriptions of the faults of the text indexes."""
    definitions, look = {"sqlite": (_SQLITE, _on_sqlite), "postgresql": (_POSTGRESQL, _on_postgresql)}[
        connection.vendor
    ]
    with connection.cursor() as cursor:
        there = dict(_defined(cursor))
        wrong = [
            f"the index {name} {'differs from the console’s own index' if name in there else 'is missing'}."
            for name, definition in definitions.items()
            if there.get(name) != definition
        ]
        yield from wrong
        if wrong:
            return
        try:
            with _one_moment(cursor):
                yield from look(cursor)
        except DatabaseError as error:
            yield f"the search index cannot be read: {error}."


def _defined(cursor: CursorWrapper) -> Iterator[tuple[str, str]]:
    """Return the name and the definition of each index that is in use."""
    if connection.vendor == "sqlite":
        cursor.execute("SELECT name, sql FROM sqlite_master WHERE name LIKE 'audit_content_s%' AND sql <> ''")
    else:
        cursor.execute(
            "SELECT relname, pg_get_indexdef(indexrelid) FROM pg_index JOIN pg_class ON pg_class.oid = indexrelid"
            " WHERE indrelid = 'audit_content'::regclass AND indisvalid AND indisready AND indislive"
        )
    for name, definition in cursor.fetchall():
        yield name, re.sub(r" ON \S+\.audit_content ", " ON audit_content ", " ".join(definition.split()))


@contextmanager
def _one_moment(cursor: CursorWrapper) -> Iterator[None]:
    """Read one snapshot of the database while others write, without a lock."""
    if connection.in_atomic_block:
        yield
    elif connection.vendor == "sqlite":
        cursor.execute("BEGIN DEFERRED")  # Django's own transactions would keep others from writing
        try:
            yield
        finally:
            cursor.execute("ROLLBACK")
    else:
        with transaction.atomic():
            cursor.execute("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY")
            yield


def _on_sqlite(cursor: CursorWrapper) -> Iterator[str]:
    cursor.execute(
        "CREATE VIRTUAL TABLE temp.audit_there USING fts5vocab(main, audit_content_search, instance)"
    )
    try:
        cursor.execute(_PLACES.format("audit_there"))
        there = {term: tuple(places) for term, *places in cursor.fetchall()}
    finally:
        cursor.execute("DROP TABLE temp.audit_there")
    said = _as_said(cursor)
    if said and not there:
        yield "the search index is empty."
    elif different := sum(there.get(term) != said.get(term) for term in there.keys() | said.keys()):
        yield (
            f"the search index does not agree with the log: {different} of {len(said)} groups of three characters"
            " are at other places."
        )


def _as_said(cursor: CursorWrapper) -> dict[str, tuple[int, int]]:
    """Return the expected content of the index, computed from the texts."""
    said: dict[str, tuple[int, int]] = {}
    last = -1
    while True:
        cursor.execute(
            "SELECT max(record_id) FROM (SELECT record_id FROM audit_content"
            " WHERE text <> '' AND record_id > %s ORDER BY record_id LIMIT %s)",
            [last, BATCH_SIZE],
        )
        (end,) = cursor.fetchone()
        if end is None:
            return said
        cursor.execute(
            "CREATE VIRTUAL TABLE temp.audit_anew USING fts5(text, content='', tokenize='trigram')"
        )
        try:
            cursor.execute(
                "INSERT INTO temp.audit_anew (rowid, text) SELECT record_id, text FROM audit_content"
                " WHERE text <> '' AND record_id > %s AND record_id <= %s",
                [last, end],
            )
            cursor.execute(
                "CREATE VIRTUAL TABLE temp.audit_words USING fts5vocab(temp, audit_anew, instance)"
            )
            try:
                cursor.execute(_PLACES.format("audit_words"))
                for term, times, places in cursor.fetchall():
                    before = said.get(term, (0, 0))
                    said[term] = (before[0] + times, before[1] + places)
            finally:
                cursor.execute("DROP TABLE temp.audit_words")
        finally:
            cursor.execute("DROP TABLE temp.audit_anew")
        last = end


def _on_postgresql(cursor: CursorWrapper) -> Iterator[str]:
    """Compare the number of texts in index and table.

    The pattern '%' makes PostgreSQL read the whole index.
    """
    counts = []
    for through_index in (True, False):
        cursor.execute(f"SET LOCAL enable_seqscan = {'off' if through_index else 'on'}")
        cursor.execute(f"SET LOCAL enable_bitmapscan = {'on' if through_index else 'off'}")
        cursor.execute(f"SET LOCAL enable_indexscan = {'on' if through_index else 'off'}")
        cursor.execute("SELECT count(*) FROM audit_content WHERE text LIKE '%%'")
        counts.append(cursor.fetchone()[0])
    for name in ("enable_seqscan", "enable_bitmapscan", "enable_indexscan"):
        cursor.execute(f"SET LOCAL {name} = DEFAULT")
    if counts[0] != counts[1]:
        yield f"the search index has {counts[0]} texts, the log has {counts[1]}."
