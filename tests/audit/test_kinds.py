"""The code, `kinds.py` and docs/audit.md list the same kinds of records."""

import ast
import re
from collections.abc import Iterator
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest

from fleet.audit.kinds import KINDS, grouped
from fleet.audit.reading import wording
from robots.records.bridge_records import ENDS
from robots.shared.wire import TASK_KINDS

ROOT = Path(__file__).parents[2]
RECORDING = {
    "record",
    "_record",
    "record_all",
    "record_booking",
    "record_bookings",
    "request",
    "outcome",
}  # functions that write records
KIND = re.compile(r"[a-z]+\.[a-z_]+|refusal|fault")

# Calls whose kind is an expression: file, expression, and its possible kinds.
INDIRECT = {
    ("fleet/accounts/sign_in/throttle.py", "KIND"): {"account.sign_in_failed"},
    ("robots/registry/services.py", "f'{entry._meta.model_name}.{verb}'"): {
        "phrase.create",
        "phrase.delete",
        "allowance.create",
        "allowance.delete",
    },
    ("robots/access/services.py", "f'{what}.{step}'"): {
        f"{what}.{step}" for what in ("group", "course", "qualification") for step in ("create", "change")
    },
    ("teleop/live/service_calls.py", "kind"): {"service.call", "parameter.set", "parameter.delete"},
    ("teleop/recordings/orders/requests.py", "kind"): {"recording.begin", "recording.end", "recording.mark"},
    ("teleop/live/task_sender.py", "f'{what}.cancel'"): {"speech.cancel", "motion.cancel"},
    ("robots/records/bridge_records.py", "kind"): {end for end, _ in ENDS.values()},
    ("teleop/alerts/telling.py", "f'alert.{what}'"): {"alert.begin", "alert.still", "alert.over"},
    ("fleet/backup/command_line.py", "kind"): {"backup.make", "backup.check", "backup.restore"},
    # These pass on a kind that their caller gives, or the kind of an existing record.
    ("fleet/accounts/changes.py", "kind"): set(),
    ("fleet/bookings/services.py", "kind"): set(),
    ("fleet/bookings/lessons/turns.py", "kind"): set(),
    ("teleop/control/services.py", "kind"): set(),
    ("teleop/stop/presses.py", "record.kind"): set(),
    ("teleop/layouts/services.py", "kind"): set(),
    ("teleop/webhooks/services.py", "kind"): set(),
    ("teleop/push/services.py", "kind"): set(),
    ("teleop/live/service_calls.py", "begun.kind"): set(),
    ("teleop/recordings/orders/requests.py", "begun.kind"): set(),
    ("teleop/recordings/orders/housekeeping.py", "begun.kind"): set(),
    ("robots/bridge/link_handler.py", "message"): set(),  # begins a recording of the robot's topics
}


@cache
def calls() -> list[tuple[str, str, list[ast.expr]]]:
    """Return file, function and arguments of each call that writes a record."""
    return list(_calls())


def _calls() -> Iterator[tuple[str, str, list[ast.expr]]]:
    for folder in ("fleet", "robots", "teleop"):
        for path in (ROOT / folder).rglob("*.py"):
            if "migrations" in path.parts:
                continue
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Call) and node.args:
                    name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                    if name in RECORDING:
                        yield path.relative_to(ROOT).as_posix(), name, node.args


def written_out(arguments: list[ast.expr]) -> set[str]:
    values = {argument.value for argument in arguments if isinstance(argument, ast.Constant)}
    return {value for value in values if isinstance(value, str) and KIND.fullmatch(value)}


# docs/protocol-messages.md, which is generated, lists these.
OF_TASKS = {name for kind in TASK_KINDS for name in (kind.record, kind.outcome)}


@pytest.fixture(scope="module")
def recorded() -> set[str]:
    return OF_TASKS.union(*INDIRECT.values(), *(written_out(arguments) for _, _, arguments in calls()))


def test_indirect_kinds_are_all_listed_above():
    found = {
        (file, ast.unparse(arguments[0]))
        for file, name, arguments in calls()
        if name == "record" and not written_out(arguments)
    }
    assert found == INDIRECT.keys()


def test_recorded_kinds_and_known_kinds_are_the_same(recorded):
    assert recorded == {name for name, kind in KINDS.items() if not kind.former}


def test_requests_of_a_killed_bridge_end_with_a_known_kind():
    assert {*ENDS, *(end for end, _ in ENDS.values())} <= KINDS.keys()


def test_every_kind_has_words_of_its_own():
    labels = [wording.label(name) for name in KINDS]
    assert len(set(labels)) == len(labels)
    assert all(label and "." not in label for label in labels)


def test_the_filter_has_every_kind_in_one_group():
    assert sorted(kind for _name, kinds in grouped(KINDS) for kind in kinds) == sorted(KINDS)
    found = {str(name): kinds for name, kinds in grouped(["health.worse", "fault", "speech.start"])}
    assert found == {"Speech": ["speech.start"], "Health and faults": ["health.worse", "fault"]}


def test_every_other_kind_has_a_row_in_the_docs_and_every_row_a_kind():
    section = (ROOT / "docs/audit.md").read_text().split("## Kinds of records")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (`.*?) \| .*\|$", section, re.MULTILINE)
    named = [whole for row in rows for whole in _in_full(re.findall(r"`([^`]+)`", row))]
    others = KINDS.keys() - OF_TASKS
    assert [name for name in others if not any(fnmatch(name, pattern) for pattern in named)] == []
    assert [pattern for pattern in named if not any(fnmatch(name, pattern) for name in KINDS)] == []


def _in_full(names: list[str]) -> Iterator[str]:
    """Yield full kinds: `.hand_over` after `control.take` becomes `control.hand_over`."""
    group = ""
    for name in names:
        group = name.split(".")[0] or group
        yield name if not name.startswith(".") else group + name
