"""A description as XML, and the values of its attributes.

The reader of RViz (TinyXML) takes texts that a strict reader of XML refuses: a mark or line before the declaration of
XML, any encoding in that declaration, ``--`` in a comment, a bare ``&``, a ``<`` in the value of an attribute, control
characters, also by their numbers, text behind the robot, a prefix without a namespace. This one takes them, too.
"""

from __future__ import annotations

import math
import re
import sys
from typing import NamedTuple
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from robots.shared.sentences import Sentence, say

LARGEST = 8_000_000  # characters
FARTHEST_M = 1_000.0
LARGEST_NUMBER = 1e6
LONGEST_NAME = 200

_DECLARATION = re.compile(r"\A<\?xml\b[^>]*\?>")
_BARE_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#[0-9]{1,7}|#x[0-9a-fA-F]{1,6});)")
_FORBIDDEN = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")  # in XML
_NUMBERED = re.compile(r"&#(?:x([0-9a-fA-F]{1,6})|([0-9]{1,7}));")
_VALUE = re.compile(r"""=\s*(?:"[^"<]*<[^"]*"|'[^'<]*<[^']*')(?=[\s/>])""")  # of an attribute, with a `<`
_NAME = re.compile(rf'[^\x00-\x1f\x7f"\\]{{1,{LONGEST_NAME}}}')  # a page puts names of links into selectors
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class BadDescription(ValueError):
    """A description that cannot be used at all; the text says why."""


class Misfit(ValueError):
    """A part that cannot be used; the text says why."""


class Description(NamedTuple):
    """A description that was read."""

    robot: Element
    problems: list[Sentence]  # what is left out


def description_of(text: str) -> Description:
    """Read a description up to the end of its robot. Entities are never expanded.

    Raises BadDescription if it is not XML, too large, no <robot>, or contains declarations, which could do harm.
    """
    if len(text) > LARGEST:
        raise BadDescription(say("the robot’s description is too large"))
    found = _Reader().read(_tidied(text))
    if found.robot.tag != "robot":
        raise BadDescription(say("the robot’s description is no <robot>"))
    return found


class _Reader:
    def __init__(self) -> None:
        self._builder, self._open = TreeBuilder(), 0
        self._robot: Element | None = None
        self._parser = parser = expat.ParserCreate("utf-8")  # without namespaces: a prefix is part of a name
        parser.StartDoctypeDeclHandler = _refuse_declarations
        parser.StartElementHandler = self._begin
        parser.EndElementHandler = self._end

    def read(self, text: str) -> Description:
        """Return the first element that stands in no other. Raises BadDescription if there is none."""
        problems = []
        try:
            self._parser.Parse(text.encode(errors="replace"), True)
        except expat.ExpatError as error:
            if self._robot is None:
                text = "the robot’s description cannot be parsed from line {line}, column {column} on"
                raise BadDescription(say(text, line=error.lineno, column=error.offset + 1)) from error
            problems = [say("the text behind the end of the robot is left out")]
        assert self._robot is not None  # noqa: S101  (else it is no XML)
        return Description(self._robot, problems)

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._open += 1
        self._builder.start(tag, attributes)

    def _end(self, tag: str) -> None:
        self._open -= 1
        self._builder.end(tag)
        if not self._open and self._robot is None:
            self._robot = self._builder.close()


def _refuse_declarations(_name: str, _system: str | None, _public: str | None, has_declarations: int) -> None:
    if has_declarations:
        raise BadDescription(say("the robot’s description contains declarations (DOCTYPE)"))


def _tidied(text: str) -> str:
    """Return the text as XML, without marks, comments and characters that XML forbids; numbers of lines stay."""
    text = _DECLARATION.sub("", text.strip("\ufeff\x00 \t\r\n"), count=1)
    first, *rest = text.split("<!--")
    kept = [first]
    for part in rest:
        comment, _, after = part.partition("-->")
        kept += ["\n" * comment.count("\n"), after]
    plain = _NUMBERED.sub(_allowed, _FORBIDDEN.sub("", "".join(kept)))
    return _VALUE.sub(lambda value: value[0].replace("<", "&lt;"), _BARE_AMPERSAND.sub("&amp;", plain))


def _allowed(number: re.Match[str]) -> str:
    """Return a character's number as it stands, nothing if XML forbids the character."""
    code = int(number[1], 16) if number[1] else int(number[2])
    if code > sys.maxunicode:
        return ""
    return number[0] if not _FORBIDDEN.match(chr(code)) else ""


def name_of(element: Element, attribute: str = "name") -> str:
    """Return a name. Raises Misfit if it is missing, or if pages cannot use it."""
    name = element.get(attribute, "")
    if not _NAME.fullmatch(name):
        if not name:
            raise Misfit(say("it has no {part}", part=attribute))
        raise Misfit(say("the name {name} cannot be used", name=repr(name[:80])))
    return name


def is_name(name: str) -> bool:
    """Return whether pages can use this name."""
    return _NAME.fullmatch(name) is not None


def numbers_of(
    element: Element, attribute: str, count: int, default: str = "", most: float = LARGEST_NUMBER
) -> tuple[float, ...]:
    """Return the attribute's `count` numbers, between blanks of any kind. Raises Misfit."""
    text = element.get(attribute, "").strip() or default
    parts = text.split()
    numbers = tuple(float(part) for part in parts if _NUMBER.fullmatch(part))
    if not len(numbers) == len(parts) == count or not all(abs(number) <= most for number in numbers):
        value, tag = repr(text[:80]), element.tag[:80]
        raise Misfit(
            say(
                "the {attribute} {value} of a <{tag}> cannot be used",
                attribute=attribute,
                value=value,
                tag=tag,
            )
        )
    return numbers


def origin_of(element: Element) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return xyz (m) and rpy (rad) of the element's <origin>; what it lacks is zero. Raises Misfit."""
    origin = element.find("origin")
    if origin is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return numbers_of(origin, "xyz", 3, "0 0 0", FARTHEST_M), numbers_of(origin, "rpy", 3, "0 0 0")


def axis_of(joint: Element) -> tuple[float, ...]:
    """Return the axis of a joint that moves, of length 1; x if it has none. Raises Misfit if its length is zero."""
    axis = joint.find("axis")
    xyz = (1.0, 0.0, 0.0) if axis is None else numbers_of(axis, "xyz", 3, "1 0 0")
    length = math.hypot(*xyz)
    if length < 1.0 / LARGEST_NUMBER:
        raise Misfit(say("its axis has no length"))
    return tuple(part / length for part in xyz)
