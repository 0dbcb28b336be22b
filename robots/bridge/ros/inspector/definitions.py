"""Message definitions of installed packages, of this project, and of publishers.

A definition is accepted only if its text has the md5 sum that the publisher claims: else it describes other bytes than
the publisher sends. Definitions of types that are not installed are kept on disk by (type, md5), for publishers that
send no text. Publishers in Java and JavaScript send a text without the types that it uses: those are added from here,
and the md5 sum says whether they are the publisher's.
"""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

import genmsg
from genmsg.gentools import compute_md5
from genmsg.msg_loader import load_msg_from_string
from genmsg.msgs import is_builtin, parse_type

from robots.bridge.topics.inspector.declined import Declined
from robots.shared.messages.definition import Definition
from robots.shared.messages.fields import FLOATS, INTEGERS
from robots.shared.messages.packing import HEADER
from robots.shared.ros.message_types.classes import UnknownTypeError, message_class
from robots.shared.sentences import Sentence, reason_of, say
from robots.shared.texts import cut
from robots.shared.wire import Field

# Before each type that a text embeds; some publishers break by dashes, or not at all.
EMBEDDED = re.compile(r"^(?:(?:={3,}|-{3,})[ \t]*\n\s*)?MSG:[ \t]*(\S+/\S+)[ \t]*$", re.MULTILINE)
_BREAK = "=" * 80
LARGEST_TEXT = 256 * 1024  # characters of a definition
MOST_FIELDS = 3000  # of a definition; a nested message counts at each place of its use
MOST_WORDS = 512 * 1024  # characters of the fields' names, types and constants, counted in the same way
DEEPEST = 20
# elements of an array of fixed length, times the lengths of the arrays that contain it
LONGEST_ARRAY = 100_000
LONGEST_WORDS = 300  # characters of a publisher's text within a sentence of ours
MOST_NAMED = 3  # types within a sentence
MOST_KEPT = 1000  # definitions on disk
MOST_FOUND = 200  # in memory

_TYPE = re.compile(r"[A-Za-z][A-Za-z0-9_]*/[A-Za-z][A-Za-z0-9_]*")
_MD5 = re.compile(r"[0-9a-f]{32}")


def parsed(type_name: str, text: str, known: bool = False) -> Definition:
    """Parse a definition's text and compute its md5 sum. Raises Declined."""
    if len(text) > LARGEST_TEXT or not _TYPE.fullmatch(type_name):
        raise _bad(type_name, say("it is too long, or its type has no proper name"))
    try:
        context, spec = _loaded(type_name, text)
        # First the fields: `compute_md5` does not limit nesting.
        fields = list(_Tree(context).fields(spec, DEEPEST))
        return Definition(type_name, compute_md5(context, spec), text, known, fields)
    except (genmsg.InvalidMsgSpec, KeyError, ValueError, IndexError) as error:
        raise _bad(type_name, reason_of(error)) from error


def sums(definition: Definition) -> frozenset[str]:
    """Return the md5 sums of a message itself and of every message within it."""
    context, _ = _loaded(definition.type, definition.text)
    specs = map(context.get_registered, _types_within(definition.fields))
    return frozenset({definition.md5, *(compute_md5(context, spec) for spec in specs)})


def _loaded(type_name: str, text: str) -> tuple[genmsg.MsgContext, genmsg.MsgSpec]:
    context = genmsg.MsgContext.create_default()
    own, *embedded = EMBEDDED.split(text)
    for name, words in zip(embedded[::2], embedded[1::2], strict=True):
        load_msg_from_string(context, words, name)
    return context, load_msg_from_string(context, own, type_name)


def _types_used(type_name: str, text: str) -> list[str]:
    """Return the message types of this text's own fields. Raises Declined if it is no definition."""
    try:
        spec = load_msg_from_string(genmsg.MsgContext.create_default(), text, type_name)
    except (genmsg.InvalidMsgSpec, ValueError, IndexError) as error:
        raise _bad(type_name, reason_of(error)) from error
    bare = (parse_type(used)[0] for used in spec.types)
    return [HEADER if used == "Header" else used for used in bare if used == "Header" or not is_builtin(used)]


def _types_within(fields: Iterable[Field]) -> set[str]:
    """Return the message types within these fields, at any depth."""
    found: set[str] = set()
    for field_ in fields:
        if not is_builtin(field_.type):
            found |= {field_.type} | _types_within(field_.fields)
    return found


class _Tree:
    """Counts a definition's fields, so that a few lines cannot expand to millions of fields, bytes or elements."""

    def __init__(self, context: genmsg.MsgContext) -> None:
        self._context = context
        self._fields_left = MOST_FIELDS
        self._words_left = MOST_WORDS

    def fields(self, spec: genmsg.MsgSpec, deeper: int, within: int = 1) -> Iterator[Field]:
        """Yield the fields. `within`: number of elements of the fixed arrays that contain this message."""
        self._count_words(*(f"{constant.name}={constant.val}" for constant in spec.constants))
        for type_name, name in zip(spec.types, spec.names, strict=True):
            self._fields_left -= 1
            if not deeper or self._fields_left < 0:
                raise ValueError(say("it nests too deeply, or has too many fields"))
            bare, is_array, length = parse_type(type_name)
            bare = HEADER if bare == "Header" else bare
            elements = within * (length or 1)
            if elements > LONGEST_ARRAY:
                raise ValueError(say("{name} has {count} elements in all", name=name, count=elements))
            nested = [] if is_builtin(bare) else list(self._nested(bare, deeper - 1, elements))
            array = None if not is_array else -1 if length is None else length
            constants = _constants(spec, bare)
            self._count_words(name, bare, *(f"{constant}={value}" for constant, value in constants.items()))
            yield Field(name, bare, array, constants, nested)

    def _nested(self, type_name: str, deeper: int, within: int) -> Iterator[Field]:
        return self.fields(self._context.get_registered(type_name), deeper, within)

    def _count_words(self, *words: str) -> None:
        self._words_left -= sum(map(len, words))
        if self._words_left < 0:
            raise ValueError(say("its names and constants are too long"))


def _constants(spec: genmsg.MsgSpec, type_name: str) -> dict[str, float | int | str | bool]:
    """Return the constants of the field's own type: a definition does not say which field they belong to."""
    if type_name not in INTEGERS and type_name not in FLOATS:
        return {}
    return {constant.name: constant.val for constant in spec.constants if constant.type == type_name}


def installed(type_name: str) -> Definition | None:
    """Return the definition of an installed package, if there is one."""
    try:
        found = message_class(type_name)
    except UnknownTypeError:
        return None
    return parsed(type_name, found._full_text, known=True)


class Definitions:
    """All definitions seen so far. Safe to use from several threads."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._found: dict[str, Definition | Declined] = {}  # by a digest of the sent definition
        self._lock = threading.Lock()

    def of_connection(self, header: dict[str, str]) -> Definition:
        """Return the definition of the publisher with this connection header. Raises Declined."""
        claimed = (header.get("type", ""), header.get("md5sum", ""), header.get("message_definition", ""))
        key = hashlib.sha256("\0".join(claimed).encode()).hexdigest()
        with self._lock:
            found = self._found.get(key)
            if found is None:
                try:
                    found = self._find(*claimed)
                except Declined as error:
                    found = error
            if len(self._found) >= MOST_FOUND:
                self._found.clear()
            if isinstance(found, Definition) or found.refusal.code != "type_unknown":
                self._found[key] = found  # an unknown type may be described by another publisher later
        if isinstance(found, Declined):
            raise found
        return found

    def of_type(self, type_name: str) -> Definition:
        """Return the installed definition, else one that a publisher sent before. Raises Declined."""
        found = installed(type_name) or next(self._kept(type_name), None)
        if found is None:
            raise _unknown(type_name)
        return found

    def text_of(self, type_name: str) -> str:
        """Return the text of `of_type`, unparsed; "" if the type is not known."""
        try:
            text: str = message_class(type_name)._full_text
        except UnknownTypeError:
            kept = next(self._kept(type_name), None)
            return kept.text if kept else ""
        return text

    def _find(self, type_name: str, md5: str, text: str) -> Definition:
        if not (_TYPE.fullmatch(type_name) and _MD5.fullmatch(md5)):
            raise _bad(type_name, say("its publisher names no proper type and md5 sum"))
        here = installed(type_name)
        if here is not None and here.md5 == md5:
            return here
        if text.strip() or here is None:
            return self._as_published(type_name, md5, text)
        raise _unknown(type_name, md5)

    def _as_published(self, type_name: str, md5: str, text: str) -> Definition:
        """Return the publisher's definition, or a kept one with the same md5 sum."""
        if not text.strip():
            for kept in self._kept(type_name, md5):
                return kept
            if md5 != parsed(type_name, "").md5:  # an empty text is a valid definition
                raise _unknown(type_name, md5)
        whole, added = self._completed(type_name, _unix(text))
        definition = parsed(type_name, whole)
        if definition.md5 != md5:
            raise Declined(
                "definition_differs",
                _differs(type_name, added),
                type=type_name,
                claimed_md5=md5,
                definition_md5=definition.md5,
            )
        self._keep(definition)
        return definition

    def _completed(self, type_name: str, text: str) -> tuple[str, list[str]]:
        """Return the text followed by those of types that it lacks, and their names. Raises Declined."""
        if len(text) > LARGEST_TEXT:
            return text, []  # `parsed` refuses it
        own, *embedded = EMBEDDED.split(text)
        texts = {type_name: own, **dict(zip(embedded[::2], embedded[1::2], strict=True))}
        added: list[str] = []
        unread = list(texts)
        while unread:
            name = unread.pop()
            for used in _types_used(name, texts[name]):
                if used not in texts:
                    texts[used] = self._own_text(used, type_name)
                    added.append(used)
                    unread.append(used)
        return "".join([text, *(f"\n{_BREAK}\nMSG: {name}\n{texts[name]}" for name in added)]), added

    def _own_text(self, type_name: str, user: str) -> str:
        """Return the text of one type without those that it uses. Raises Declined."""
        try:
            found = self.of_type(type_name)
        except Declined as error:
            name = type_name[:LONGEST_WORDS]
            why = say(
                "The console does not know {name}, which {user} uses, and its publisher does not describe it.",
                name=name,
                user=user,
            )
            raise Declined("type_unknown", why, type=name) from error
        return EMBEDDED.split(found.text)[0]

    # --- on disk --------------------------------------------------------------------------------------

    def _kept(self, type_name: str, md5: str = "*") -> Iterator[Definition]:
        """Yield the kept definitions, newest first. An edited file has another md5 sum and is skipped."""
        pattern = f"{type_name.replace('/', '--')}--{md5}.msg"
        if not _TYPE.fullmatch(type_name):
            return
        files = sorted(self._folder.glob(pattern), key=lambda file: file.stat().st_mtime, reverse=True)
        for file in files:
            try:
                kept = parsed(type_name, file.read_text())
            except (Declined, OSError, UnicodeError):
                continue
            if file.stem.endswith(kept.md5):
                yield kept

    def _keep(self, definition: Definition) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        file = self._folder / f"{definition.type.replace('/', '--')}--{definition.md5}.msg"
        if file.exists() or sum(1 for _ in self._folder.iterdir()) >= MOST_KEPT:
            return
        draft = file.with_suffix(".draft")
        draft.write_text(definition.text)
        draft.replace(file)


def _unix(text: str) -> str:
    """Return the text with line ends as on Unix, without the mark of other editors at its beginning."""
    return text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


def _differs(type_name: str, added: list[str]) -> Sentence:
    """Return the words of a definition that has another md5 sum, with the types that the console added."""
    if not added:
        return say(
            "The publisher’s definition of {type} is not the one of its md5 sum: "
            "the console cannot decode its messages.",
            type=type_name,
        )
    return say(
        "The publisher’s definition of {type}, with the console’s own {added}, is not the one of its md5 sum: "
        "the console cannot decode its messages.",
        type=type_name,
        added=", ".join(added[:MOST_NAMED]),
    )


def _unknown(type_name: str, md5: str = "") -> Declined:
    text = say("The console does not know {type}, and its publisher sends no definition.", type=type_name)
    return Declined("type_unknown", text, type=type_name, md5=md5)


def _bad(type_name: str, why: str) -> Declined:
    name = type_name[:LONGEST_WORDS]
    text = say("The definition of {name} cannot be read: {why}.", name=name, why=cut(why, LONGEST_WORDS))
    return Declined("bad_definition", text, type=name)
