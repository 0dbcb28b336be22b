"""Writes docs/errors.md: each code of a refusal, its rule, its HTTP status, and the sentences that it comes with.

Codes and sentences are constants of the source, or variables to which their function assigns constants.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import NamedTuple

from fleet.audit.errors import CAUSES
from robots.shared.sentences import pieces
from robots.shared.wire import Refusal
from script.generate.sentences import _argument, _within, has_words, modules

PAGE = Path(__file__).parents[2] / "docs" / "errors.md"
HEAD = """# Error codes

*Reference.* `script/messages` writes this page from the source. Each refusal has a code, which stays the same; `type`
of a problem document is the address of its code here. {braces} stand for the figures of the case.
[api.md](api.md#errors) and [protocol.md](protocol.md#refusals) list the codes by status and by rule.

"""
# Calls that make a refusal: the places of code, sentence and rule among the arguments; a rule that is no argument
_MADE: dict[str, tuple[int, int, int | str]] = {
    "Refusal": (0, 1, 2),
    "_no": (0, 1, "booking"),
    "_not_by": (1, 2, "booking"),
    "HttpRefusal": (2, 3, "limits"),
    "TokenInvalid": (0, 1, "account"),
    "Fault": (0, 1, "wire"),
    "WebhookRefused": (0, 1, "wire"),
}
_SAID = ("say", "counted", "_")
# Codes and sentences that are no constants of one call
_OTHERS = {
    "method_not_allowed": (
        "wire",
        "This address does not take this method: the header Allow lists those it takes.",
    ),
    "not_acceptable": ("wire", "Accept JSON: no other answer is offered here."),
    "unsupported_media_type": (
        "wire",
        "Send the body as JSON, with the header Content-Type: application/json.",
    ),
    "too_many_changes": ("audit", "One person makes no more changes in this time: go on later."),
    "no_camera_info": ("robot", "The lens of the camera is not known: no camera info comes."),
    "bad_camera_info": ("robot", "The camera info does not fit the picture."),
    "no_camera_place": ("robot", "The place of the camera on the robot is not known."),
    "navigation_goes_on": ("robot", "The robot drives to a place that another program requested."),
    "bad_picture": ("robot", "The picture of the camera cannot be read."),
    "token_expired": ("account", "This token has expired, or was ended: make a new one."),
    "control_ended": ("lease", "Control ended while this was asked for or went on."),
    "broken": ("robot", "The record of this cannot be read."),
    "too_much": ("robot", "The topic sends more than the console reads."),
}


class Code(NamedTuple):
    """A code where the source uses it."""

    name: str
    rule: str
    text: str
    place: str = ""  # its module


class Scope(NamedTuple):
    """The variables of a function: for each, the lines and values of its assignments; and the lines of its refusals."""

    assigned: dict[str, list[tuple[int, ast.expr]]]
    made: list[int]

    def values(self, name: str, line: int) -> list[ast.expr]:
        """Return the values that a variable may have at this line: those since the refusal before."""
        before = max((one for one in self.made if one < line), default=0)
        known = self.assigned.get(name, [])
        near = [value for at, value in known if before < at <= line]
        return near or [value for _, value in known]


def found() -> Iterator[Code]:
    """Yield each use of a code that is a constant."""
    for name, (rule, text) in _OTHERS.items():
        yield Code(name, rule, text)
    for code, cause in {code: cause for _, code, cause in CAUSES}.items():
        for rule in ("audit", "database"):
            yield Code(f"{rule}_{code}", rule, f"Not done: {cause}.")
    for rule in ("audit", "database"):
        yield Code(f"{rule}_unreachable", rule, "Not done: the database does not answer.")
    for place, source in modules():
        tree = ast.parse(source)
        shared = _scope(tree)
        for node in (tree, *(one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef))):
            own = _scope(node)
            scope = Scope(shared.assigned | own.assigned, own.made)
            for call in (one for one in _within(node) if isinstance(one, ast.Call)):
                yield from (code._replace(place=place) for code in _of(call, scope))


def _scope(node: ast.AST) -> Scope:
    assigned: dict[str, list[tuple[int, ast.expr]]] = {}
    made = []
    for one in _within(node):
        if isinstance(one, ast.Call) and _name(one) in _MADE:
            made.append(one.lineno)
        pairs: list[tuple[ast.expr, ast.expr]] = []
        if isinstance(one, ast.AnnAssign) and one.value is not None:
            pairs = [(one.target, one.value)]
        elif isinstance(one, ast.Assign) and isinstance(one.targets[0], ast.Tuple):
            values = one.value.elts if isinstance(one.value, ast.Tuple) else []
            pairs = list(zip(one.targets[0].elts, values, strict=False))
        elif isinstance(one, ast.Assign):
            pairs = [(one.targets[0], one.value)]
        for target, value in pairs:
            if isinstance(target, ast.Name):
                assigned.setdefault(target.id, []).append((value.lineno, value))
    return Scope(assigned, made)


def _name(call: ast.Call) -> str:
    return call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")


def _of(call: ast.Call, scope: Scope) -> Iterator[Code]:
    if _name(call) not in _MADE:
        return
    code, text, rule = _MADE[_name(call)]
    rules = (
        [rule] if isinstance(rule, str) else list(_texts(_argument(call, rule, "rule"), scope, call.lineno))
    )
    texts = list(_texts(_argument(call, text, "text"), scope, call.lineno))
    codes = list(_texts(_argument(call, code, "code"), scope, call.lineno))
    pairs = zip(codes, texts, strict=True) if len(codes) == len(texts) else product(codes, texts or [""])
    for one, said in pairs:
        yield Code(one, rules[0] if rules else "", said)


def _texts(node: ast.expr | None, scope: Scope, line: int) -> Iterator[str]:
    """Yield the constants that an expression may be at this line."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _texts(node.body, scope, line)
        yield from _texts(node.orelse, scope, line)
    elif isinstance(node, ast.Name):
        for value in scope.values(node.id, line):
            if not isinstance(value, ast.Name):
                yield from _texts(value, scope, line)
    elif isinstance(node, ast.Call) and _name(node) in _SAID:
        yield from _texts(node.args[0] if node.args else None, scope, line)


def page() -> str:
    """Return the page."""
    from teleop.api.v1.framework.problems import Problem  # Django's apps must be ready

    texts: defaultdict[str, dict[str, None]] = defaultdict(dict)
    rules: dict[str, str] = {}
    places: defaultdict[str, set[str]] = defaultdict(set)
    for code in found():
        places[code.name] |= {f"`{code.place}`"} if code.place else set()
        rules[code.name] = rules.get(code.name) or code.rule
        if has_words(code.text):
            texts[code.name][_plain(code.text)] = None
    sections = []
    for name in sorted(rules):
        rule = rules[name] or "robot"
        status = Problem(Refusal(name, "", rule)).status  # type: ignore[arg-type]
        said = "".join(f"* {text}\n" for text in texts[name])
        made = f" Made in {', '.join(sorted(places[name]))}." if places[name] else ""
        sections.append(f"## {name}\n\nRule *{rule}*, HTTP {status}.{made}\n\n{said}".rstrip() + "\n")
    return HEAD + "\n".join(sections)


def _plain(key: str) -> str:
    """Return a sentence with the bare names of its figures in braces."""
    return "".join(text if not name else text + "{" + name + "}" for text, name, _ in pieces(key))
