"""Writes docs/protocol-messages.md (every field of every message) from `robots.shared.wire`; and docs/openapi.json.

Types and defaults come from the structs; descriptions come from their docstrings and the comments next to fields.
"""

from __future__ import annotations

import ast
import inspect
import io
import json
import os
import re
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin, get_type_hints
from uuid import UUID

import msgspec
from msgspec import Meta, Struct, UnsetType, structs

from robots.shared import wire
from script.generate import errors

PAGE = Path(__file__).parents[2] / "docs" / "protocol-messages.md"
OPENAPI = PAGE.with_name("openapi.json")
HEAD = f"""# Messages, field by field

*Reference.* `script/messages` writes this page from [robots/shared/wire/](../robots/shared/wire/).
[protocol.md](protocol.md) says how to use the messages (`protocol` {wire.PROTOCOL}).
Each is one JSON object whose `t` is its name here. A field without a default is required. Unknown fields are
ignored; a report may leave out fields with their default. *Optional*: null by default. Units are SI unless the
name says otherwise. Messages between the console's own processes are in `robots/shared/wire/links/bridge.py`,
`camera.py`, `tap.py` and `shelf.py` only.

"""
COMMON = 5  # a field that so many messages have is described once, at the top
DIRECTIONS: Mapping[str, Any] = {
    "From a robot's page to the console": wire.BrowserMessage,
    "From the console to a robot's page": wire.BrowserReport,
    "From readers of topics to the console": wire.TopicsMessage,
    "From the console to readers of topics": wire.TopicsReport,
    "From the fleet page to the console": wire.FleetMessage,
    "From the console to the fleet page": wire.FleetReport,
    "From readers of cameras to the console": wire.CameraMessage,
    "From the console to readers of cameras": wire.CameraReport,
    "From the console to the calendar": wire.BookingsReport,
    "From the console to every page: notifications": wire.NewsReport,
}
# Messages between the console's own processes
INTERNAL = (
    wire.LinkRequest,
    wire.LinkReport,
    wire.CameraRequest,
    wire.TakenPicture,
    wire.TapWants,
    wire.TapHeader,
    wire.ShelfRead,
    wire.ShelfPart,
    wire.TapState,
)
WORDS = {
    bool: "boolean",
    int: "integer",
    float: "number",
    str: "string",
    UUID: "UUID",
    Any: "any value",
    msgspec.Raw: "a message, handed on untouched",
    NoneType: "null",
    UnsetType: "nothing",
}

Kind = type[Struct]


def page() -> str:
    """Return the text of the page."""
    described_at: dict[Kind, str] = {}  # for each message, the section that describes it
    left_out = _parts(*INTERNAL) - _parts(*DIRECTIONS.values(), wire.PictureHeader)  # of a binary message
    left_out.add(wire.TaskStates)  # `State` has its fields
    common = _common()
    fields = "\n".join(f"* {line}" for line in common.values())
    sections = [f"{HEAD}Fields that several messages have in common:\n\n{fields}\n"]
    for door, union in DIRECTIONS.items():
        kinds = _kinds(union)
        before = [kind for kind in kinds if kind in described_at]
        sections.append(f"## {door}\n")
        for kind in kinds:
            if kind not in described_at:
                described_at[kind] = door
                sections.append(_section(kind, common))
        if before:
            sections.append(f"As above: {', '.join(map(_link, before))}.\n")
    sections.append(_kinds_of_tasks())
    sections.append("## Parts of messages\n")
    sections += [
        _section(kind, common)
        for kind in _structs()
        if kind not in described_at and kind not in left_out and not kind.__name__.startswith("_")
    ]
    return "\n".join(sections)


def _kinds_of_tasks() -> str:
    """Return the table of `wire.TASK_KINDS`."""
    lines = [
        "## Kinds of tasks\n",
        "A token needs the scope. The address in REST is below `/api/v1`; [api.md](api.md#page-and-api) has those of "
        "kinds with several.\n",
        "| kind | request, and cancel | scope | REST | records |\n|---|---|---|---|---|",
    ]
    for kind in wire.TASK_KINDS:
        requests = ", ".join(map(_link, kind.requests))
        methods = "POST" if kind.cancel is None else "POST, DELETE"
        address = f"`{methods} /robots/{{slug}}/{kind.address}`" if kind.address else ""
        records = ", ".join(f"`{name}`: {label}" for name, label in kind.records.items())
        lines.append(f"| `{kind.name}` | {requests} | `{kind.scope}` | {address} | {records} |")
    return "\n".join([*lines, ""])


def _kinds(union: Any) -> list[Kind]:
    return [kind for part in get_args(union) for kind in (get_args(part) or (part,))]


def _parts(*hints: Any) -> set[Kind]:
    """Return the message types in these type hints, and the types in their fields."""
    found: set[Kind] = set()
    waiting = list(hints)
    while waiting:
        hint = waiting.pop()
        waiting += get_args(hint)
        if inspect.isclass(hint) and issubclass(hint, Struct) and hint not in found:
            found.add(hint)
            waiting += get_type_hints(hint, include_extras=True).values()
    return found


def _structs() -> Iterator[Kind]:
    """Yield all message types of `wire`, in the order of the module."""
    for kind in vars(wire).values():
        if (
            inspect.isclass(kind)
            and issubclass(kind, Struct)
            and kind.__module__.startswith(f"{wire.__name__}.")
        ):
            yield kind


def _name(kind: Kind) -> str:
    """Return a message's tag (with the struct's name if several messages share the tag), or a part's name."""
    tag = kind.__struct_config__.tag
    if tag is None:
        return f"`{kind.__name__}`"
    shared = sum(other.__struct_config__.tag == tag for other in _structs()) > 1
    return f"`{tag}` ({kind.__name__})" if shared else f"`{tag}`"


def _link(kind: Kind) -> str:
    name = _name(kind)
    return f"[{name}](#{re.sub(r'[^a-z0-9_ -]', '', name.lower()).replace(' ', '-')})"


def _section(kind: Kind, common: Mapping[str, str]) -> str:
    lines = [f"### {_name(kind)}\n", f"{_words_of(kind)}\n"]
    fields = _fields(kind)
    shared = [f"`{name}`" for name, line in fields.items() if common.get(name) == line]
    lines += [f"* {line}" for name, line in fields.items() if common.get(name) != line]
    if shared:
        lines.append(f"* {', '.join(shared)}")
    return "\n".join([*lines, ""]) if fields else "\n".join(lines)


def _fields(kind: Kind) -> dict[str, str]:
    """Return the description of each field."""
    structs_of_wire = [base for base in reversed(kind.__mro__) if base.__module__.startswith(wire.__name__)]
    comments = {name: words for base in structs_of_wire for name, words in _comments(base).items()}
    hints = get_type_hints(kind, include_extras=True)
    lines = {}
    for field in structs.fields(kind):
        default, comment = _default(field), comments.get(field.name, "")
        words = _type(hints[field.name])
        if default == "`null`" or field.default is msgspec.UNSET:
            line = f"`{field.name}`: {re.sub(' or (null|nothing)$', '', words)}, optional"
        else:
            line = f"`{field.name}`: {words}{f', default {default}' if default else ''}"
        lines[field.name] = f"{line}. {comment[:1].upper()}{comment[1:]}" if comment else line
    return lines


def _common() -> dict[str, str]:
    """Return the fields that at least `COMMON` messages describe with the same words."""
    counts = Counter(pair for kind in _structs() for pair in _fields(kind).items())
    often = [pair for pair, count in counts.most_common() if count >= COMMON and "," in pair[1]]
    return dict(reversed(often))  # if a name has two descriptions, the more frequent one wins


def _words_of(kind: Kind) -> str:
    """Return the docstring, with the names of JSON instead of Python's."""
    return _renamed(inspect.getdoc(kind) or "")


def _renamed(text: str) -> str:
    """Replace Python's names of messages and of null by the names in JSON."""
    text = re.sub(r"\bNone\b", "null", text)
    tags = {kind.__name__: kind.__struct_config__.tag for kind in _structs()}
    return re.sub(r"`(\w+)`", lambda found: f"`{tags.get(found[1]) or found[1]}`", text)


def _default(field: structs.FieldInfo) -> str:
    default = field.default
    if default is msgspec.NODEFAULT and field.default_factory is not msgspec.NODEFAULT:
        default = field.default_factory()
    return (
        "" if default in (msgspec.NODEFAULT, msgspec.UNSET) else f"`{msgspec.json.encode(default).decode()}`"
    )


def _type(hint: Any) -> str:
    """Return a type in words."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _bounded(arguments[0], arguments[1:])
    if origin in (Union, UnionType):
        return " or ".join(map(_type, arguments))
    if origin is Literal:
        return ", ".join(f"`{value}`" for value in arguments)
    if origin is list:
        return f"list of {_type(arguments[0])}"
    if origin is tuple and arguments[-1] is Ellipsis:
        return f"list of {_type(arguments[0])}"
    if origin is tuple:
        return f"[{', '.join(map(_type, arguments))}]"
    if origin is not None and issubclass(origin, Mapping):
        return f"object, {_type(arguments[0])} to {_type(arguments[1])}"
    return WORDS[hint] if hint in WORDS else _link(hint)


def _figure(bound: float) -> str:
    return "2^53 - 1" if bound == 2**53 - 1 else f"{bound:g}"


def _bounded(hint: Any, bounds: tuple[Meta, ...]) -> str:
    words = [_type(hint)]
    for meta in bounds:
        unit = " characters" if hint is str else " entries" if get_origin(hint) is list else ""
        low, high = (meta.min_length, meta.max_length) if unit else (meta.ge, meta.le)
        if low is not None and high is not None:
            words.append(f"{_figure(low)} to {_figure(high)}{unit}")
        elif high is not None:
            words.append(
                f"{f'above {meta.gt:g}, ' if meta.gt is not None else ''}at most {_figure(high)}{unit}"
            )
        elif low is not None:
            words.append(f"at least {_figure(low)}{unit}")
        if meta.pattern:
            words.append(f"of the form `{meta.pattern}`")
    return ", ".join(words)


def _comments(kind: Kind) -> dict[str, str]:
    """Return the comment before or next to each field, by the field's name."""
    source = inspect.getsource(kind)
    comments = {
        token.start[0]: token.string.lstrip("# ")
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    }
    fields = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    ]
    code = {line for node in fields for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)}
    found: dict[str, str] = {}
    for node in fields:
        first = node.lineno
        while first - 1 in comments and first - 1 not in code:
            first -= 1
        lines = range(first, (node.end_lineno or node.lineno) + 1)
        found[cast(ast.Name, node.target).id] = " ".join(
            _renamed(comments[line]) for line in lines if line in comments
        )
    return found


def openapi() -> str:
    """Return the schema of the API as JSON."""
    from drf_spectacular.generators import SchemaGenerator  # Django's apps must be ready

    schema = SchemaGenerator().get_schema(request=None, public=True)  # type: ignore[no-untyped-call]
    return json.dumps(schema, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    import django

    os.environ.update(DJANGO_SETTINGS_MODULE="fleet.settings", FLEET_DEBUG="1")
    django.setup()
    PAGE.write_text(page())
    OPENAPI.write_text(openapi())
    errors.PAGE.write_text(errors.page())
