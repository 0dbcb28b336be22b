"""A task that waits for its record begins only if its requester keeps control without a break."""

import pytest

from tests.bridge.support import ORDERS, ObedientBench, runs_out


@pytest.fixture
def bench():
    return ObedientBench()


@pytest.mark.parametrize("what", ORDERS)
def test_every_task_begins_after_its_record(bench, what):
    bench.sink.open.clear()
    bench.ask(ORDERS[what])
    assert bench.begun == []
    bench.sink.open.set()
    bench.obeys()
    assert len(bench.begun) == 1


def comes_back(bench):
    """The page is loaded again, and has control as before."""
    bench.core.pause(1, "the page was left", 1, bench.now_s)
    bench.granted()


@pytest.mark.parametrize("what", ORDERS)
@pytest.mark.parametrize(
    "happens",
    [
        lambda bench: bench.core.link_lost(1, bench.now_s),
        lambda bench: bench.granted(link=2),
        lambda bench: bench.granted(fence=2),
        runs_out,
        comes_back,
    ],
)
def test_waiting_task_is_refused_and_recorded_without_control(bench, what, happens):
    bench.sink.open.clear()
    answers = bench.ask(ORDERS[what])
    happens(bench)
    bench.sink.open.set()
    bench.obeys()
    assert bench.begun == []
    assert len(answers) == 1
    _, (_, end) = bench.sink.records
    assert end.outcome not in ("", "unknown")


@pytest.mark.parametrize("what", ORDERS)
def test_waiting_task_is_refused_when_its_page_goes(bench, what):
    bench.sink.open.clear()
    answers = bench.ask(ORDERS[what])
    comes_back(bench)
    assert [refusal.code for refusal in answers] == ["link_lost"]
    anew = bench.ask(ORDERS[what])
    bench.sink.open.set()
    bench.obeys()
    assert ([refusal.code for refusal in answers], anew) == (["link_lost"], [None])
    assert len(bench.begun) == 1


@pytest.mark.parametrize("what", sorted(ORDERS.keys() - {"drive_by", "go"}))
def test_page_that_goes_without_waiting_tasks_changes_nothing(bench, what):
    answers = bench.ask(ORDERS[what])
    bench.obeys()
    records = len(bench.sink.records)
    comes_back(bench)
    bench.obeys()
    assert answers == [None]
    assert (len(bench.begun), len(bench.sink.records)) == (1, records)


@pytest.mark.parametrize("what", ORDERS)
def test_ended_bridge_sends_no_requests(bench, what):
    bench.core.close(bench.now_s)
    assert bench.order(ORDERS[what]).code == "no_lease"


def test_message_in_check_is_not_recorded_when_the_bridge_ends(bench):
    bench.publisher.waiting = []
    answers = bench.ask(ORDERS["publish"])
    bench.core.close(bench.now_s)
    bench.publisher.waiting.pop()()
    assert [refusal.code for refusal in answers] == ["no_lease"]
    assert bench.sink.records == []


def test_stick_is_refused_between_expiry_and_the_next_tick(bench):
    bench.driving(0.3)
    runs_out(bench)
    sent = len(bench.base.sent)
    assert bench.stick(0.5).code == "no_lease"
    bench.core.recorded(bench.now_s)
    assert all(velocity.vx == 0.0 for velocity in bench.base.sent[sent:])
