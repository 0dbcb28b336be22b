"""Search records by their texts: parts of words, in any script, without case.

Words of three characters and more are looked up in an index of trigrams (FTS5 on SQLite, pg_trgm on PostgreSQL).
Shorter ones have none: they are looked for in text after text, newest first; so is on PostgreSQL what stands in many.
Accents count: "manana" does not find "mañana".
"""

from __future__ import annotations

import itertools
import re
import unicodedata
from typing import Any

from django.db import connection
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.models import Lookup, Q, QuerySet, TextField, Value
from django.db.models.functions import StrIndex
from django.db.models.lookups import GreaterThan

from fleet.audit.models import Content, ContentSearch

TRIGRAM = 3  # characters: a shorter word is in no index
BRIEF = 2000  # bytes: room of PostgreSQL's index of texts (fleet.audit.integrity.triggers)
_WORD = re.compile(r'"([^"]+)"|(\S+)')

Texts = QuerySet[Content] | QuerySet[ContentSearch]  # their primary keys are the records' numbers


def words_of(asked: str) -> tuple[str, ...]:
    """The words that a text must have, in any order; words in double quotes stay together."""
    found = _WORD.findall(unicodedata.normalize("NFC", asked))
    return tuple(word for quoted, plain in found if (word := (quoted or plain).replace('"', "").strip()))


def indexed(words: tuple[str, ...]) -> bool:
    """Return whether these words, if there are any, are looked up rather than looked for in all texts."""
    return not words or any(len(word) >= TRIGRAM for word in words)


def texts_with(words: tuple[str, ...]) -> list[Texts]:
    """Texts that have all of these words: queries with an index each, to be read in the order of their numbers."""
    long = tuple(word for word in words if len(word) >= TRIGRAM)
    texts: Texts = _having(long)
    if long and connection.vendor == "sqlite":
        texts = ContentSearch.objects.filter(text__matches=" ".join(f'"{word}"' for word in long))
    for word in words:
        if word not in long:
            texts = texts.filter(_part(word))
    if connection.vendor == "sqlite":
        return [texts]
    return [texts.filter(text__brief=True), texts.filter(text__brief=False)]


def texts_among(numbers: list[int], words: tuple[str, ...]) -> QuerySet[Content]:
    """Texts of these few records that have all of these words."""
    return _having(words).filter(pk__in=numbers)


def _having(words: tuple[str, ...]) -> QuerySet[Content]:
    texts = Content.objects.filter(text__said=True)
    for word in words:
        texts = texts.filter(text__having=word)
    return texts


def _part(word: str) -> Q:
    """For one or two characters, in each way to write them. Not by LIKE: PostgreSQL would read all of its trigrams."""
    either = Q()
    for letters in itertools.product(*({letter.lower(), letter.upper()} for letter in word)):
        either |= Q(GreaterThan(StrIndex("text", Value("".join(letters))), 0))
    return either


# --- lookups --------------------------------------------------------------------------------------

Sql = tuple[str, Any]


@TextField.register_lookup
class Matches(Lookup):
    """`text__matches`: a search in FTS5's index. Each word is quoted, so that none is an operator."""

    lookup_name = "matches"

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """SQLite only."""
        left, left_values = self.process_lhs(compiler, connection)
        right, right_values = self.process_rhs(compiler, connection)
        return f"{left} MATCH {right}", [*left_values, *right_values]


@TextField.register_lookup
class Said(Lookup):
    """`text__said=True`: that there is a text, in the very words of the index of them."""

    lookup_name = "said"

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """A parameter in place of '' would keep SQLite from using the index."""
        left, values = self.process_lhs(compiler, connection)
        return f"{left} <> ''", values


@TextField.register_lookup
class Brief(Lookup):
    """`text__brief=True` or False: whether PostgreSQL's index of texts has room for it, in the index's own words."""

    lookup_name = "brief"
    prepare_rhs = False  # it would become a text

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """PostgreSQL only."""
        left, values = self.process_lhs(compiler, connection)
        return f"octet_length({left}) {'<=' if self.rhs else '>'} {BRIEF}", values


@TextField.register_lookup
class Having(Lookup):
    """`text__having=word`: that the word is part of it, capitals or not."""

    lookup_name = "having"

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """PostgreSQL's ILIKE uses the index of trigrams."""
        left, values = self.process_lhs(compiler, connection)
        pattern = connection.ops.prep_for_like_query(self.rhs)
        return f"{left} ILIKE %s", [*values, f"%{pattern}%"]

    def as_sqlite(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """In Python, by Django's REGEXP: for few texts."""
        left, values = self.process_lhs(compiler, connection)
        return f"{left} REGEXP %s", [*values, f"(?i){re.escape(self.rhs)}"]
