"""Every kind of task ends once, for every cause, with its outcome recorded.

The tables say what must happen, without a look at the declarations of the parts: a changed reaction fails.
"""

from types import SimpleNamespace
from typing import get_args
from unittest.mock import Mock

import pytest

from robots.bridge.robot_reports import RosStatus
from robots.bridge.tasks.parts import PARTS
from robots.bridge.tasks.task import Cause, Reaction, TaskPart
from robots.shared import wire
from robots.shared.wire import TASK_KINDS, Refusal
from tests.bridge.support import ORDERS, ObedientBench, Outcome, codes

KINDS = {kind.name: kind for kind in TASK_KINDS}
CANCELS = {
    "motion": wire.PlayCancel(1),
    "speech": wire.SayCancel(1),
    "drive_by": wire.DriveByCancel(1),
    "go": wire.GoCancel(1),
    "limb": wire.LimbCancel(1, "gripper"),
    "publish": wire.PublishStop(1, "/notes"),
}


class GoesOn(str):
    """Why a task survives a cause."""


class Later(str):
    """Code with which a waiting task is refused only when it is recorded."""


BASE = GoesOn("the cause ends only a drive that runs")
MASTER = GoesOn("the robot's nodes work without their master; the robot reports how the task ends")
RELOAD = GoesOn("a page may be reloaded: LINK_LOST follows in 2 s")
SPOKEN = GoesOn("a text is spoken to its end: it moves nothing")
CHOICE = GoesOn("a choice moves nothing; it ends with control, or by another choice")
BRIEF = GoesOn("its kind has no cancel: it is over as soon as it is sent")

# Kinds that are over when they begin, and why they last no longer.
AT_ONCE = {
    "look_ahead": "the head's controller ends each step by itself",
    "turn_head": "one position for the head's controller",
    "set_pose": "one message, which moves nothing",
    "forget": "only the gate's memory changes",
}

# The code with which a running task ends, by kind and cause.
HELD = {
    Cause.CANCELLED: "cancelled",
    Cause.SUPERSEDED: BASE,
    Cause.GATE: BASE,
    Cause.HALTED: BASE,
    Cause.ROBOT_GONE: MASTER,
    Cause.STOPPED: "stopped",
    Cause.CONTROL_ENDED: "control_ended",
    Cause.PAGE_LEFT: RELOAD,
    Cause.LINK_LOST: "link_lost",
    Cause.UNRECORDED: "not_recorded",
    Cause.BRIDGE_ENDED: "bridge_ended",
}
DRIVE = HELD | {
    Cause.SUPERSEDED: "replaced",
    Cause.GATE: "obstacle",
    Cause.HALTED: "input_moved",
    Cause.ROBOT_GONE: "robot_offline",
    **dict.fromkeys((Cause.CONTROL_ENDED, Cause.PAGE_LEFT, Cause.LINK_LOST), "control_lost"),
}
RUNNING = {
    "motion": HELD | {Cause.BRIDGE_ENDED: "control_ended"},
    "limb": HELD,
    "publish": HELD,
    "speech": HELD
    | dict.fromkeys((Cause.CONTROL_ENDED, Cause.LINK_LOST, Cause.UNRECORDED), SPOKEN)
    | {Cause.BRIDGE_ENDED: "unheard"},
    "choose": HELD
    | dict.fromkeys((Cause.CANCELLED, Cause.STOPPED, Cause.LINK_LOST, Cause.UNRECORDED), CHOICE),
    "drive_by": DRIVE,
    "go": DRIVE | {Cause.GATE: "held_back"},
}

# The code with which a waiting task is refused, and the recorded one if it differs.
ASKED = HELD | {Cause.ROBOT_GONE: Later("robot_offline"), Cause.PAGE_LEFT: "link_lost"}
WAITING = {
    "motion": ASKED,
    "limb": ASKED,
    "publish": ASKED
    | {Cause.STOPPED: ("halted", "stopped"), Cause.CONTROL_ENDED: ("halted", "control_ended")},
    "speech": ASKED | {Cause.ROBOT_GONE: Later("cancelled"), Cause.CONTROL_ENDED: "cancelled"},
    "choose": ASKED
    | {Cause.CANCELLED: CHOICE, Cause.STOPPED: Later("stopped"), Cause.CONTROL_ENDED: "no_lease"},
    "drive_by": ASKED
    | {Cause.STOPPED: ("halted", "stopped"), Cause.CONTROL_ENDED: ("halted", "control_lost")},
    "go": ASKED | {Cause.SUPERSEDED: "replaced", Cause.CONTROL_ENDED: "control_lost"},
    **dict.fromkeys(
        AT_ONCE, ASKED | {Cause.CANCELLED: BRIEF, Cause.STOPPED: "halted", Cause.CONTROL_ENDED: "halted"}
    ),
}
# Kinds that record a success when they begin.
BEGUN = {"choose": ["chosen"]} | {what: ["sent"] for what in AT_ONCE}

# Kinds whose ends pages do not show.
UNSHOWN = {"publish", "choose"}

# Kinds that are refused while a task runs, by the code of the refusal.
MEANWHILE: dict[str, dict[str, set[str]]] = {
    "motion": {
        "motion_running": {"motion", "limb", "drive_by", "go", "look_ahead", "turn_head", "forget"},
    },
    "limb": {"limb_moving": {"motion", "drive_by", "go"}},
    "publish": {},
    "speech": {"speaking": {"speech"}},
    "choose": {},
    "drive_by": {
        "base_moving": {"motion", "limb", "choose", "go", "set_pose", "forget"},
        "driving": {"drive_by"},
    },
    "go": {"going": KINDS.keys() - {"publish", "speech"}},
}


@pytest.fixture
def bench():
    bench = ObedientBench()
    yield bench
    bench.records.close()


def cancelled(bench, what):
    if KINDS[what].cancel:
        assert bench.order(CANCELS[what]) is None


def superseded(bench, what):
    bench.core.tasks.superseded(bench.now_s)


def held_back(bench, what):
    bench.core.tasks.held_back("obstacle", "Something is near.", bench.now_s)


def halted(bench, what):
    bench.core.halt("input_moved", "input goes elsewhere", bench.now_s)


def robot_gone(bench, what):
    bench.core.ros_status(RosStatus("waiting", "The master is gone."), bench.now_s)


def stopped(bench, what):
    bench.core.stop("Bob", "", bench.now_s)


def control_ended(bench, what):
    bench.core.revoke(1, "It was revoked.", bench.now_s)


def page_left(bench, what):
    bench.core.pause(1, "the page was left", 1, bench.now_s)


def link_lost(bench, what):
    page_left(bench, what)
    bench.pass_time(1.05)
    bench.reports(obeys=False)
    bench.pass_time(1.0)


def unrecorded(bench, what):
    bench.core.tasks.unrecorded(Refusal("not_recorded", "The disk is full.", "audit"), bench.now_s)


def bridge_ended(bench, what):
    bench.core.close(bench.now_s)


HAPPENS = {
    Cause.CANCELLED: cancelled,
    Cause.SUPERSEDED: superseded,
    Cause.GATE: held_back,
    Cause.HALTED: halted,
    Cause.ROBOT_GONE: robot_gone,
    Cause.STOPPED: stopped,
    Cause.CONTROL_ENDED: control_ended,
    Cause.PAGE_LEFT: page_left,
    Cause.LINK_LOST: link_lost,
    Cause.UNRECORDED: unrecorded,
    Cause.BRIDGE_ENDED: bridge_ended,
}


def outcomes(bench, what):
    """The recorded outcomes of this kind."""
    bench.recorded()
    end = KINDS[what].outcome
    return [record.outcome for kind, record in bench.sink.records if kind == end and type(record) is Outcome]


def shown(bench):
    """The outcomes that pages see."""
    ends = [end.last for part in bench.core.tasks.parts for end in part.ends]
    return [end.outcome for end in ends if end is not None]


def test_every_kind_and_every_cause_is_in_these_tables():
    described = [kind for part in PARTS for kind in part.kinds]
    assert {kind.name for kind in described} == KINDS.keys() == ORDERS.keys() == WAITING.keys()
    assert len(described) == len(TASK_KINDS) == len(RUNNING) + len(AT_ONCE)
    assert set(get_args(wire.TaskRequest)) == {request for kind in TASK_KINDS for request in kind.requests}
    assert RUNNING.keys() == MEANWHILE.keys() == KINDS.keys() - AT_ONCE.keys()
    assert all(row.keys() == set(Cause) for row in (HAPPENS, *RUNNING.values(), *WAITING.values()))
    cancelled = {what for what, row in WAITING.items() if row[Cause.CANCELLED] == "cancelled"}
    assert {kind.name for kind in TASK_KINDS if kind.cancel} == CANCELS.keys() == cancelled


def test_a_zero_that_fails_keeps_no_task_running(bench, monkeypatch):
    bench.ask(ORDERS["motion"])
    bench.obeys()
    with monkeypatch.context() as patched, pytest.raises(OSError, match="no network"):
        patched.setattr(bench.base, "publish", Mock(side_effect=OSError("no network")))
        control_ended(bench, "motion")
    bench.reports()
    assert outcomes(bench, "motion") == ["control_ended"]


def test_an_answer_that_fails_keeps_no_task_running(bench, monkeypatch):
    bench.ask(ORDERS["publish"])
    bench.obeys()
    publications = bench.core.tasks.publications
    monkeypatch.setattr(publications, "drop", Mock(side_effect=OSError("no answer")))
    with pytest.raises(OSError, match="no answer"):
        stopped(bench, "publish")
    assert outcomes(bench, "publish") == ["stopped"]


@pytest.mark.parametrize("cause", Cause)
@pytest.mark.parametrize("what", RUNNING)
def test_a_running_task_ends_once_or_goes_on(bench, what, cause):
    expected, tasks = RUNNING[what][cause], bench.core.tasks
    ends = [] if type(expected) is GoesOn else [expected]
    before, seen = tasks.headline(bench.now_s), tasks.state(bench.now_s)
    answers = bench.ask(ORDERS[what])
    bench.obeys()
    begun = tasks.headline(bench.now_s)
    assert (answers, len(bench.begun), outcomes(bench, what)) == ([None], 1, BEGUN.get(what, []))
    assert begun != before
    assert tasks.state(bench.now_s) != seen  # pages see the task
    # without records, only a task that is not counted may go on
    assert bool(tasks.under_way) == (type(RUNNING[what][Cause.UNRECORDED]) is not GoesOn)
    HAPPENS[cause](bench, what)
    assert set(bench.base.cancelled_goals) == {goal for goal in bench.goals if ends not in ([], ["unheard"])}
    # the end waits for the robot: a goal is watched until it is over, a chosen drive topic until the base stands
    waits = (bench.goals or what == "choose") and cause is not Cause.BRIDGE_ENDED
    assert outcomes(bench, what) == BEGUN.get(what, []) + ([] if waits else ends)
    for _ in range(2):
        bench.reports()
        bench.core.tick(bench.now_s)
        HAPPENS[cause](bench, what) if cause is not Cause.CANCELLED else None
    assert outcomes(bench, what) == BEGUN.get(what, []) + ends
    assert shown(bench) == ([] if what in UNSHOWN else ends)
    assert not ends or tasks.headline(bench.now_s) != begun
    assert (answers, len(bench.begun)) == ([None], 1 + (what == "choose" and cause is Cause.CONTROL_ENDED))


@pytest.mark.parametrize("cause", Cause)
@pytest.mark.parametrize("what", WAITING)
def test_a_waiting_task_is_refused_once_or_begins(bench, what, cause):
    expected = WAITING[what][cause]
    begins = type(expected) is GoesOn
    bench.sink.open.clear()
    answers = bench.ask(ORDERS[what])
    assert answers == []
    HAPPENS[cause](bench, what)
    assert len(answers) == (type(expected) not in (GoesOn, Later))
    bench.sink.open.set()
    bench.obeys()
    code, outcome = expected if type(expected) is tuple else (expected, expected)
    assert codes(answers) == [None if begins else code]
    assert (outcomes(bench, what), len(bench.begun)) == (BEGUN.get(what, []) if begins else [outcome], begins)


@pytest.mark.parametrize("what", RUNNING)
def test_a_running_task_forbids_others(what):
    refused = {}
    for other, order in ORDERS.items():
        bench = ObedientBench()
        bench.ask(ORDERS[what])
        bench.obeys()
        answers = bench.ask(order)
        if answers and answers[0]:
            refused.setdefault(answers[0].code, set()).add(other)
        bench.records.close()
    assert refused == MEANWHILE[what]


def test_a_part_without_a_reaction_cannot_be_defined():
    some = {cause: Reaction.END for cause in Cause if cause is not Cause.STOPPED}
    members = {"kinds": (wire.FORGET,), "reactions": some}
    with pytest.raises(TypeError, match="Lamps has no reaction to STOPPED"):
        type("Lamps", (TaskPart,), members)
    with pytest.raises(TypeError, match="Lamps cannot cancel its tasks"):
        type("Lamps", (TaskPart,), {"kinds": (wire.MOTION,), "reactions": dict.fromkeys(Cause, Reaction.END)})


def test_a_failing_part_keeps_no_other_from_its_end(bench, monkeypatch):
    parts = bench.core.tasks.parts
    first, *others = [part for part in parts if part.reactions[Cause.STOPPED] is not Reaction.GO_ON]
    told = []
    for part in others:
        monkeypatch.setattr(part, "tell", lambda ending, now_s: told.append(ending.cause))
    monkeypatch.setattr(first, "tell", SimpleNamespace)
    with pytest.raises(TypeError):
        bench.core.stop("Bob", "", bench.now_s)
    assert told == [Cause.STOPPED] * len(others)
