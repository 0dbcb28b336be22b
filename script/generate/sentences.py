"""Writes the catalogue of sentences: what bridge and web process say about robots, with named figures in braces.

Keys come from the source (`told`); `fleet/locale/LANGUAGE/LC_MESSAGES/sentences.po` keeps the translations, and
`sentences.mo` is what pages read. Needs GNU gettext.
"""

from __future__ import annotations

import ast
import json
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from fleet.audit.reading.words import WORDS
from robots.shared.sentences import pieces

ROOT = Path(__file__).parents[2]
LOCALE = ROOT / "fleet" / "locale"
FOLDERS = ("fleet", "robots", "teleop")
# Calls whose argument at this place is a sentence, and the keyword of the same argument
TOLD = {
    "say": (0, "key"),
    "catalogued": (0, "text"),
    "counted": (0, "one"),
    "Refusal": (1, "text"),
    "Notice": (2, "text"),
    "Fault": (1, "text"),
    "LimitedTwist": (2, "text"),
    "NeutralNeeded": (1, "text"),
    "_no": (1, "text"),
    "MasterError": (0, "text"),
    "Namesake": (0, "text"),
    "NodeLost": (0, "text"),
    "RosStatus": (1, "text"),
    "Declined": (1, "text"),
    "Malformed": (0, "text"),
    "PoseUnknown": (0, "text"),
    "complain": (1, "words"),
    "replace": (9, "text"),  # of a struct, which keeps the figures of its former text beside a plain text
    "BadField": (1, "text"),
}
HEAD = r"""msgid ""
msgstr ""
"Content-Type: text/plain; charset=UTF-8\n"
"Content-Transfer-Encoding: 8bit\n"

"""


class Key(NamedTuple):
    """A sentence of the source."""

    one: str
    many: str  # empty: it has one form
    place: str  # module


class Told(NamedTuple):
    """A sentence where the source says it: a constant, or something else."""

    text: ast.expr
    many: ast.expr | None
    line: int


def told(source: str) -> Iterator[Told]:
    """Return all sentences of a module. A variable stands for each text that its function assigns to it."""
    tree = ast.parse(source)
    for scope in (tree, *(node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))):
        assigned: dict[str, list[ast.expr]] = {}
        for node in _within(scope):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                assigned.setdefault(node.targets[0].id, []).append(node.value)
        for call in (node for node in _within(scope) if isinstance(node, ast.Call)):
            name = call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")
            text = _argument(call, *TOLD[name]) if name in TOLD else None
            many = _argument(call, 1, "many") if name == "counted" else None
            for value in assigned.get(text.id, []) if isinstance(text, ast.Name) else [text] if text else []:
                yield Told(value, many, call.lineno)


def _within(scope: ast.AST) -> Iterator[ast.AST]:
    """Return the nodes of a scope without those of the functions in it."""
    for node in ast.iter_child_nodes(scope):
        if not isinstance(node, ast.FunctionDef):
            yield node
            yield from _within(node)


def _argument(call: ast.Call, position: int, keyword: str) -> ast.expr | None:
    named = next((one.value for one in call.keywords if one.arg == keyword), None)
    return call.args[position] if len(call.args) > position else named


def _constants(node: ast.expr | None) -> Iterator[str]:
    """Return the texts that an expression may have: a constant, or either end of a condition."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from _constants(node.body)
        yield from _constants(node.orelse)


def has_words(key: str) -> bool:
    """Return whether a key has words beside its figures."""
    return any(letter.isalpha() for text, _, _ in pieces(key) for letter in text)


def modules() -> Iterator[tuple[str, str]]:
    """Return each module that may have sentences: its path and its source."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield str(path.relative_to(ROOT)), path.read_text()


@cache
def keys() -> dict[str, Key]:
    """Return all sentences of the source by key."""
    found = {word: Key(word, "", "fleet/audit/reading/words.py") for word in WORDS}
    for place, source in modules():
        for sentence in told(source):
            many = next(_constants(sentence.many), "")
            for one in filter(has_words, _constants(sentence.text)):
                found.setdefault(one, Key(one, many, place))
    return found


def _entry(key: Key) -> str:
    many = f"msgid_plural {_quoted(key.many)}\n" if key.many else ""
    empty = 'msgstr[0] ""\nmsgstr[1] ""\n' if key.many else 'msgstr ""\n'
    return f"#: {key.place}\nmsgid {_quoted(key.one)}\n{many}{empty}\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def main() -> None:
    """Merge the source's sentences into each language's catalogue, and compile it."""
    template = HEAD + "".join(_entry(key) for key in sorted(keys().values(), key=lambda key: key[::-1]))
    for language in sorted(LOCALE.iterdir()):
        catalogue = language / "LC_MESSAGES" / "sentences.po"
        po, options = str(catalogue), ["--no-wrap", "--sort-by-file"]
        _run("msgmerge", "--quiet", "--no-fuzzy-matching", *options, po, "-", "-o", po, text=template)
        _run("msgattrib", "--no-obsolete", *options, po, "-o", po)
        compiled(catalogue)


def compiled(catalogue: Path) -> None:
    """Compile a catalogue."""
    _run("msgfmt", str(catalogue), "-o", str(catalogue.with_suffix(".mo")))


def _run(*command: str, text: str = "") -> None:
    subprocess.run(command, input=text.encode(), check=True)  # noqa: S603 - gettext's own commands


if __name__ == "__main__":
    main()
