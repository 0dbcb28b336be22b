"""Selects and orders the tests of a run: `--only short` or `--only long`, and `--shuffle SEED`.

`tests/long.txt` lists the long tests, each group with its reason. A name is a test, one case of it, a file or a folder;
`*` stands for anything.
Property tests run in both: with few examples, and with many.
"""

from __future__ import annotations

import os
import random
import re
from pathlib import Path

import hypothesis
import pytest
from hypothesis import is_hypothesis_test

LIST = Path(__file__).parent / "long.txt"
NAMES = [line for line in LIST.read_text().splitlines() if line.strip() and not line.startswith("#")]
PATTERNS = [re.escape(name).replace(re.escape("*"), ".*") for name in NAMES]
LONG = re.compile(r"({})([\[/:].*)?".format("|".join(PATTERNS)), re.DOTALL)

# Every run tries the same examples, so that only a change can cause a new failure. With
# HYPOTHESIS_PROFILE=search, a run tries new examples. No deadline: a busy machine slows examples.
UNTIMED = hypothesis.settings(deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow])
hypothesis.settings.register_profile("short", UNTIMED, derandomize=True, max_examples=20)
hypothesis.settings.register_profile("long", UNTIMED, derandomize=True, max_examples=300)
hypothesis.settings.register_profile("search", UNTIMED, max_examples=300)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--only", choices=("short", "long"), help="only tests out of tests/long.txt, or only those in it"
    )
    parser.addoption(
        "--shuffle", type=int, metavar="SEED", help="files, and the tests of each, in random order"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Choose how many examples property tests try."""
    usual = "long" if config.getoption("only") == "long" else "short"
    hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", usual))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what was not asked for; then shuffle. What tests/script sorts afterwards keeps its order of files."""
    if only := config.getoption("only"):
        kept, left_out = [], []
        for item in items:
            runs = is_long(item.nodeid) == (only == "long") or is_hypothesis_test(getattr(item, "obj", None))
            (kept if runs else left_out).append(item)
        items[:] = kept
        config.hook.pytest_deselected(items=left_out)
    if (seed := config.getoption("shuffle")) is not None:
        shuffle(items, seed)


def is_long(test: str) -> bool:
    """Return whether the list has this test, or a file or folder that it is in."""
    return LONG.fullmatch(test) is not None


def shuffle(items: list[pytest.Item], seed: int) -> None:
    """Put the files in random order, and the tests of each: tests of a file share consoles and robots.

    A test that ends what they share is marked `last`.
    """
    dice = random.Random(seed)  # noqa: S311 - an order, no secret
    files: dict[Path, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.path, []).append(item)
    order = list(files.values())
    dice.shuffle(order)
    for tests in order:
        dice.shuffle(tests)
        tests.sort(key=lambda test: test.get_closest_marker("last") is not None)
    items[:] = [item for tests in order for item in tests]
