"""Search records by their texts: parts of words, in any script, ignoring case.

Words of three characters and more are looked up in an index of trigrams (FTS5 on SQLite, pg_trgm on
PostgreSQL). Shorter words are searched in text after text, newest first. PostgreSQL also does that for words
that many texts have. Accents count: "manana" does not find "mañana".
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

TRIGRAM = 3  # characters: the index does not find shorter words
BRIEF = 2000  # bytes: the longest text in PostgreSQL's index of texts (fleet.audit.integrity.triggers)
_WORD = re.compile(r'"([^"]+)"|(\S+)')

Texts = QuerySet[Content] | QuerySet[ContentSearch]  # primary keys: the records' numbers


def words_of(asked: str) -> tuple[str, ...]:
    """Return the words that a text must contain, in any order; words in double quotes stay together."""
    found = _WORD.findall(unicodedata.normalize("NFC", asked))
    return tuple(word for quoted, plain in found if (word := (quoted or plain).replace('"', "").strip()))


def indexed(words: tuple[str, ...]) -> bool:
    """Return whether the index finds these words; if not, all texts are searched. True without words."""
    return not words or any(len(word) >= TRIGRAM for word in words)


def texts_with(words: tuple[str, ...]) -> list[Texts]:
    """Return queries for the texts that have all of these words.

    Each uses an index; read them in order of number.
    """
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
    """Return the texts of these few records that have all of these words."""
    return _having(words).filter(pk__in=numbers)


def _having(words: tuple[str, ...]) -> QuerySet[Content]:
    texts = Content.objects.filter(text__not_empty=True)
    for word in words:
        texts = texts.filter(text__having=word)
    return texts


def _part(word: str) -> Q:
    """Match one or two characters in upper or lower case.

    For LIKE, PostgreSQL would read its whole trigram index.
    """
    either = Q()
    for letters in itertools.product(*({letter.lower(), letter.upper()} for letter in word)):
        either |= Q(GreaterThan(StrIndex("text", Value("".join(letters))), 0))
    return either


# --- lookups --------------------------------------------------------------------------------------

Sql = tuple[str, Any]


@TextField.register_lookup
class Matches(Lookup):
    """`text__matches`: search in the index of FTS5.

    The caller quotes each word, so that none is an operator.
    """

    lookup_name = "matches"

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """Return the condition; only for SQLite."""
        left, left_values = self.process_lhs(compiler, connection)
        right, right_values = self.process_rhs(compiler, connection)
        return f"{left} MATCH {right}", [*left_values, *right_values]


@TextField.register_lookup
class NotEmpty(Lookup):
    """`text__not_empty=True`: there is a text.

    The condition is written exactly as in the definition of the index.
    """

    lookup_name = "not_empty"

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """Return the condition. With a parameter in place of '', SQLite would not use the index."""
        left, values = self.process_lhs(compiler, connection)
        return f"{left} <> ''", values


@TextField.register_lookup
class Brief(Lookup):
    """`text__brief`: whether PostgreSQL's index contains the text.

    Written exactly as in the index's definition.
    """

    lookup_name = "brief"
    prepare_rhs = False  # else the value would become a text

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """Return the condition; only for PostgreSQL."""
        left, values = self.process_lhs(compiler, connection)
        return f"octet_length({left}) {'<=' if self.rhs else '>'} {BRIEF}", values


@TextField.register_lookup
class Having(Lookup):
    """`text__having=word`: the text contains the word, ignoring case."""

    lookup_name = "having"

    def as_sql(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """Return the condition for PostgreSQL. Its ILIKE uses the index of trigrams."""
        left, values = self.process_lhs(compiler, connection)
        pattern = connection.ops.prep_for_like_query(self.rhs)
        return f"{left} ILIKE %s", [*values, f"%{pattern}%"]

    def as_sqlite(self, compiler: Any, connection: BaseDatabaseWrapper) -> Sql:
        """Return the condition for SQLite: Django's REGEXP. It runs in Python and is only for few texts."""
        left, values = self.process_lhs(compiler, connection)
        return f"{left} REGEXP %s", [*values, f"(?i){re.escape(self.rhs)}"]
