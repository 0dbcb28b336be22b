"""Definitions of the types whose packages are installed, read from their files. Imports no class of a message."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import lru_cache

from rosidl_adapter.parser import (
    InvalidSpecification,
    InvalidValue,
    MessageSpecification,
    parse_message_string,
)

from robots.bridge.ros2.versions import hash_of, package_file
from robots.shared.messages.definition import Definition
from robots.shared.messages.fields import STAMPS
from robots.shared.messages.serialization import CDR
from robots.shared.sentences import reason_of, say
from robots.shared.wire import Field

BREAK = "=" * 80  # before each type that a text embeds
MOST_CACHED = 500
PARTS = {  # the texts of a service and of an action, between lines of three dashes
    "srv": ("Request", "Response"),
    "action": ("Goal", "Result", "Feedback"),
}
# Messages that an action's server and clients exchange around these parts.
# Source: design.ros2.org/articles/actions.html, "Goal Service" to "Feedback Topic"
WRAPPED = {
    "SendGoal_Request": "unique_identifier_msgs/UUID goal_id\n{name}_Goal goal\n",
    "SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp\n",
    "GetResult_Request": "unique_identifier_msgs/UUID goal_id\n",
    "GetResult_Response": "int8 status\n{name}_Result result\n",
    "FeedbackMessage": "unique_identifier_msgs/UUID goal_id\n{name}_Feedback feedback\n",
}
_NUMBERS = {"byte": "uint8", "char": "uint8"}  # neither has a sign in ROS 2
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/(?:(?:msg|srv|action)/)?([A-Z][A-Za-z0-9]*)(?:_([A-Za-z_]+))?")
_DASHES = re.compile(r"^---[ \t]*$", re.MULTILINE)


class UnknownTypeError(Exception):
    """No installed package has this type, or the console cannot read its definition; the reason is for people."""


@lru_cache(MOST_CACHED)
def definition(type_name: str) -> Definition:
    """Return the definition of a message, or of a part of a service or an action, by its name with or without its kind.

    For example: geometry_msgs/msg/Twist, geometry_msgs/Twist, std_srvs/srv/SetBool_Request,
    nav2_msgs/action/NavigateToPose_Feedback, nav2_msgs/action/NavigateToPose_FeedbackMessage.
    Raises UnknownTypeError.
    """
    own, fields = _read(type_name)
    embedded = (f"{BREAK}\nMSG: {name}\n{_read(name)[0]}" for name in sorted(_types_within(fields)))
    return Definition(
        type_name, type_hash(type_name), "".join((own, *embedded)), True, list(fields), serialization=CDR
    )


@lru_cache(MOST_CACHED)
def _read(type_name: str) -> tuple[str, tuple[Field, ...]]:
    """Return the text of one type, without those that it uses, and its fields."""
    package, name, part = _named(type_name)
    text = _text(package, name, part)
    if text is None:
        raise UnknownTypeError(say("No installed package has the type {type}.", type=type_name))
    try:
        found = parse_message_string(package, name, text)
    except (InvalidSpecification, InvalidValue, TypeError, ValueError) as error:
        raise UnknownTypeError(
            say("The definition of {name} cannot be read: {why}.", name=type_name, why=reason_of(error))
        ) from error
    return text, tuple(_fields(found, type_name))


def _fields(found: MessageSpecification, type_name: str) -> Iterator[Field]:
    for one in found.fields:
        kind = one.type
        bare = f"{kind.pkg_name}/{kind.type}" if kind.pkg_name else _NUMBERS.get(kind.type, kind.type)
        if bare == "wstring":
            raise UnknownTypeError(
                say("{name} has a text of wide characters, which the console does not read.", name=type_name)
            )
        length = -1 if kind.array_size is None or kind.is_upper_bound else kind.array_size
        constants = {each.name: each.value for each in found.constants if each.type == kind.type}
        nested = list(_read(bare)[1]) if kind.pkg_name and bare not in STAMPS else []
        yield Field(one.name, bare, length if kind.is_array else None, constants, nested)


def _types_within(fields: Iterable[Field]) -> set[str]:
    """Return the types of messages within these fields, at any depth."""
    found: set[str] = set()
    for one in fields:
        if "/" in one.type:
            found |= {one.type} | _types_within(one.fields)
    return found


# --- files of packages ---------------------------------------------------------------------------


def _named(type_name: str) -> tuple[str, str, str]:
    """Return the package, the name of the file, and the part of it: "" for a message. Raises UnknownTypeError."""
    found = _TYPE.fullmatch(type_name)
    if found is None:
        raise UnknownTypeError(say("{type} is no name of a type.", type=type_name))
    return found[1], found[2], found[3] or ""


def _text(package: str, name: str, part: str) -> str | None:
    if not part:
        return package_file(package, "msg", f"{name}.msg")
    if part in WRAPPED:
        within = package_file(package, "action", f"{name}.action") is not None
        return WRAPPED[part].format(name=f"{package}/{name}") if within else None
    for kind, parts in PARTS.items():
        whole = package_file(package, kind, f"{name}.{kind}") if part in parts else None
        if whole is not None:
            return _DASHES.split(whole)[parts.index(part)].lstrip("\n")
    return None


def type_hash(type_name: str) -> str:
    """Return the hash of an installed type, by which publishers name its version; empty if there is none."""
    package, name, part = _named(type_name)
    found = (hash_of(f"{package}/{kind}/{name}", part) for kind in ("msg", *PARTS))
    return next(filter(None, found), "")
