"""Every kind of task ends once, for every cause, with its outcome recorded."""

from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from robots.bridge.robot_reports import RosStatus
from robots.bridge.tasks.parts import PARTS
from robots.bridge.tasks.task import Cause, Reaction, TaskPart
from robots.shared import wire
from robots.shared.wire import TASK_KINDS, Refusal
from tests.bridge.support import ORDERS, ObedientBench, Outcome

KINDS = {kind.name: kind for kind in TASK_KINDS}
CANCELS = {
    "motion": wire.PlayCancel(1),
    "speech": wire.SayCancel(1),
    "drive_by": wire.DriveByCancel(1),
    "go": wire.GoCancel(1),
    "limb": wire.LimbCancel(1, "gripper"),
    "publish": wire.PublishStop(1, "/notes"),
}
# Kinds that go on although this happens while they run. All others end.
GO_ON = {
    Cause.CANCELLED: {"choose"},
    Cause.SUPERSEDED: {"motion", "limb", "publish", "speech", "choose"},
    Cause.GATE: {"motion", "limb", "publish", "speech", "choose"},
    Cause.HALTED: {"motion", "limb", "publish", "speech", "choose"},
    Cause.ROBOT_GONE: {"motion", "limb", "publish", "speech", "choose"},
    Cause.STOPPED: {"choose"},
    Cause.CONTROL_ENDED: {"speech"},
    Cause.PAGE_LEFT: {"motion", "limb", "publish", "speech", "choose"},
    Cause.LINK_LOST: {"speech", "choose"},
    Cause.UNRECORDED: {"speech", "choose"},
    Cause.BRIDGE_ENDED: set(),
}
LASTING = ("motion", "limb", "publish", "speech", "choose", "drive_by", "go")


@pytest.fixture
def bench():
    return ObedientBench()


def cancelled(bench, what):
    if what in CANCELS:
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
    bench.now_s += 2.1
    bench.odometry()
    bench.reports()
    bench.core.tick(bench.now_s)


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


def test_every_kind_has_a_part_and_is_in_these_tables():
    described = [kind for part in PARTS for kind in part.kinds]
    assert {kind.name for kind in described} == KINDS.keys() == ORDERS.keys()
    assert len(described) == len(TASK_KINDS)
    assert HAPPENS.keys() == GO_ON.keys() == set(Cause)
    assert {kind.name for kind in TASK_KINDS if kind.cancel} == CANCELS.keys()


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
@pytest.mark.parametrize("what", LASTING)
def test_a_running_task_ends_once_or_goes_on(bench, what, cause):
    answers = bench.ask(ORDERS[what])
    bench.obeys()
    assert (answers, len(bench.begun), outcomes(bench, what)) in [
        ([None], 1, []),
        ([None], 1, ["chosen"]),  # a choice is recorded when it is made, and once more when it ends
    ]
    before = len(outcomes(bench, what))
    HAPPENS[cause](bench, what)
    ends = what not in GO_ON[cause]
    for _ in range(2):
        bench.reports()
        bench.core.tick(bench.now_s)
        HAPPENS[cause](bench, what) if cause is not Cause.CANCELLED else None
    assert len(outcomes(bench, what)) - before == int(ends)
    assert (answers, len(bench.begun)) == ([None], 1 + (what == "choose" and cause is Cause.CONTROL_ENDED))


@pytest.mark.parametrize(
    "cause", [cause for cause in Cause if all(part.reactions[cause] is not Reaction.GO_ON for part in PARTS)]
)
@pytest.mark.parametrize("what", ORDERS)
def test_a_waiting_task_is_refused_once(bench, what, cause):
    bench.sink.open.clear()
    answers = bench.ask(ORDERS[what])
    assert answers == []
    HAPPENS[cause](bench, what)
    assert len(answers) == 1 and answers[0] is not None
    bench.sink.open.set()
    bench.obeys()
    assert (len(answers), bench.begun, len(outcomes(bench, what))) == (1, [], 1)


def test_a_part_without_a_reaction_cannot_be_defined():
    some = {cause: Reaction.END for cause in Cause if cause is not Cause.STOPPED}
    members = {"kinds": (wire.FORGET,), "reactions": some}
    with pytest.raises(TypeError, match="Lamps has no reaction to STOPPED"):
        type("Lamps", (TaskPart,), members)
    with pytest.raises(TypeError, match="Lamps cannot cancel its tasks"):
        type("Lamps", (TaskPart,), {"kinds": (wire.MOTION,), "reactions": dict.fromkeys(Cause, Reaction.END)})


def test_a_failing_part_keeps_no_other_from_its_end(bench, monkeypatch):
    first, *others = bench.core.tasks.parts
    told = []
    for part in others:
        monkeypatch.setattr(part, "tell", lambda ending, now_s: told.append(ending.cause))
    monkeypatch.setattr(first, "tell", SimpleNamespace)
    with pytest.raises(TypeError):
        bench.core.stop("Bob", "", bench.now_s)
    assert told == [Cause.STOPPED] * len(others)
