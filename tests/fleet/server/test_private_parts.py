"""The door uses private parts of its libraries only as its table of exceptions says."""

import ast
import importlib
import inspect
import pkgutil
import re
from pathlib import Path

import daphne.server  # noqa: F401 - first: it chooses Twisted's reactor

import fleet.server
import fleet.site
import teleop.live
import teleop.stop
from tests.processes import REPOSITORY

LIBRARIES = {"twisted", "autobahn", "daphne", "channels", "django", "uvicorn", "asgiref", "httptools"}
TABLE = REPOSITORY / "docs" / "decisions" / "public-interfaces.md"
PRIVATE = re.compile(
    r"_(?!meta$|state$)[a-zA-Z]\w*"
)  # `_meta` and `_state` of models are in Django's documentation


def modules():
    for package in (fleet.server, fleet.site, teleop.live, teleop.stop):
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not found.name.endswith("__main__"):
                yield importlib.import_module(found.name)


def is_of_library(kind):
    return kind.__module__.partition(".")[0] in LIBRARIES


def overridden(module):
    """Private names of libraries that classes of this module replace."""
    for kind in vars(module).values():
        if inspect.isclass(kind) and kind.__module__ == module.__name__:
            theirs = {name for base in kind.__mro__ if is_of_library(base) for name in vars(base)}
            yield from theirs & {name for name in vars(kind) if PRIVATE.fullmatch(name)}


def named(trees):
    """Private names that the code reads, writes or imports, but that it does not define."""
    nodes = [node for tree in trees for node in ast.walk(tree)]
    used = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    used |= {
        node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)
    } & set(LISTED)
    imported = {
        alias.name for node in nodes if isinstance(node, ast.ImportFrom) and node.level == 0
        and node.module.partition(".")[0] in LIBRARIES for alias in node.names
    }  # fmt: skip
    own = {
        node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    }
    own |= {
        node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
        and getattr(node.value, "id", "") == "self"
    }  # fmt: skip
    own |= {
        node.target.id
        for node in nodes
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
    own |= {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return {name for name in (used - own) | imported if PRIVATE.fullmatch(name)}


def rows():
    """The rows of the table: part, and the test that fails when it changes."""
    for line in TABLE.read_text().splitlines():
        if line.startswith("| `"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            yield cells[0], cells[-1].strip("`")


LISTED = {name for part, _ in rows() for name in re.findall(r"`(?:[\w.]+\.)?(\w+)`", part)}


def test_the_table_names_every_private_part():
    found = set()
    trees = []
    for module in modules():
        found |= set(overridden(module))
        trees.append(ast.parse(Path(module.__file__).read_text()))
    found |= named(trees)
    assert found == {name for name in LISTED if PRIVATE.fullmatch(name)}


def test_each_part_has_a_test():
    for part, place in rows():
        path, _, name = place.partition("::")
        assert f"def {name}(" in (REPOSITORY / path).read_text(), part
