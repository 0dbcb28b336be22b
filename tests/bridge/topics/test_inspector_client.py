"""Inspector client: each query gets its answer, failures are reported, nothing blocks or piles up."""

from __future__ import annotations

import asyncio
import signal
import sys
import textwrap
from collections.abc import AsyncIterator, Callable
from typing import Any

import msgspec
import pytest

from robots.bridge.topics import inspector_client, line_process
from robots.bridge.topics.inspector_client import MAX_QUERIES, InspectorClient
from robots.shared import wire
from tests.bridge.support import CONFIG

Spawned = list[asyncio.subprocess.Process]
PATIENCE_S = 20.0
KILLED = (-signal.SIGKILL, 255)  # 255: asyncio read the status before its child watcher
ORDER = wire.Publish(1, "/notes", "std_msgs/String", {"data": "hello"})
AT_A_RATE = msgspec.structs.replace(ORDER, rate_hz=5.0)

# An inspector that answers queries with its process id. Some names in a query change its behaviour.
PROGRAM = textwrap.dedent("""
    import json, os, sys, time

    def say(**report):
        print(json.dumps(report), flush=True)

    config = json.loads(sys.stdin.readline())
    say(t="ready")
    for line in sys.stdin:
        request = json.loads(line)
        match request["t"]:
            case "inspect":
                name = request["ask"].get("name", "")
                if name == "/die":
                    os._exit(1)
                if name == "/doze":
                    time.sleep(600.0)
                if name == "/babble":
                    print("not JSON", flush=True)
                if name != "/silent":
                    value = [os.getpid(), config["slug"]]
                    answer = {"t": "parameter_value", "name": name, "value": value, "seq": request["ask"].get("seq", 0)}
                    say(t="inspected", seq=request["seq"], answer=answer)
            case "subscribed":
                for topic, rate in request["topics"].items():
                    say(t="link_sample", topic=topic, sample={"rate": rate})
            case "check":
                wrong = request["order"]["fields"].get("data") == "wrong"
                refusal = {"code": "bad_field", "text": "No.", "rule": "wire"} if wrong else None
                say(t="done", number=request["number"], refusal=refusal)
            case "halt_publishing" if request["topic"] != "/deaf":
                say(t="done", number=request["number"], refusal=None)
            case "publish":
                say(t="link_sample", topic="/published", sample=request["fields"])
""")


class Viewer:
    """A link that stores its reports."""

    def __init__(self) -> None:
        self.answers: list[wire.LinkAnswer] = []
        self.seen: dict[str, Any] = {}
        self.news = asyncio.Event()

    def report(self, message: Any) -> None:
        self.answers.append(message)
        self.news.set()

    def show_sample(self, topic: str, seen: bytes) -> None:
        report = wire.link_report(seen)
        assert isinstance(report, wire.LinkSample)
        self.seen[topic] = msgspec.json.decode(report.sample)
        self.news.set()

    async def until(self, condition: Callable[[], Any]) -> Any:
        while not (value := condition()):
            await asyncio.wait_for(self.news.wait(), PATIENCE_S)
            self.news.clear()
        return value

    async def answer(self, seq: int) -> Any:
        """The answer to this query."""
        inspected = await self.until(lambda: [given for given in self.answers if given.seq == seq])
        return msgspec.json.decode(inspected[0].answer, type=wire.TopicAnswer)


def question(seq: int, name: str = "/a") -> wire.LinkQuery:
    return wire.LinkQuery(seq, wire.GetParameter(name, seq=seq + 1000))


@pytest.fixture
def spawned(monkeypatch) -> Spawned:
    """The inspector's processes so far."""
    processes: Spawned = []
    spawn = asyncio.create_subprocess_exec

    async def spawn_and_note(*command: str, **options: Any) -> asyncio.subprocess.Process:
        processes.append(await spawn(*command, **options))
        return processes[-1]

    monkeypatch.setattr(asyncio, "create_subprocess_exec", spawn_and_note)
    return processes


@pytest.fixture
async def make() -> AsyncIterator[Callable[..., InspectorClient]]:
    made = []

    def build(**changes: Any) -> InspectorClient:
        changes = {"lost": lambda: None, "command": (sys.executable, "-c", PROGRAM)} | changes
        made.append(InspectorClient(CONFIG, **changes))
        return made[-1]

    yield build
    for relay in made:
        await relay.close()


@pytest.fixture
def relay(make) -> InspectorClient:
    built: InspectorClient = make()
    return built


async def started(relay: InspectorClient, spawned: Spawned) -> tuple[Viewer, asyncio.subprocess.Process]:
    """Subscribe to a topic; return the viewer and the inspector's process."""
    ann = Viewer()
    relay.set_subscriptions(ann, {"/x": 1.0})
    await ann.until(lambda: ann.seen)
    return ann, spawned[-1]


async def test_answer_goes_to_its_requester_with_its_number(relay):
    ann, ben = Viewer(), Viewer()
    relay.ask(ann, question(7, "/ann"))
    relay.ask(ben, question(7, "/ben"))
    for viewer, name in ((ann, "/ann"), (ben, "/ben")):
        answer = await viewer.answer(7)
        assert (answer.name, answer.seq) == (name, 1007)
        assert len(viewer.answers) == 1


async def test_answer_to_a_closed_link_is_dropped(relay):
    ann, ben = Viewer(), Viewer()
    relay.ask(ann, question(1))
    relay.forget(ann)
    relay.ask(ben, question(2))
    await ben.answer(2)
    assert ann.answers == []


async def test_samples_go_to_subscribers_at_the_highest_wanted_rate(relay):
    ann, ben = Viewer(), Viewer()
    relay.set_subscriptions(ben, {"/x": 5.0})
    relay.set_subscriptions(ann, {"/x": 2.0, "/y": 1.0})
    await ann.until(lambda: len(ann.seen) == 2 and ann.seen["/x"] == {"rate": 5.0})
    assert ben.seen == {"/x": {"rate": 5.0}}
    relay.forget(ben)
    await ann.until(lambda: ann.seen["/x"] == {"rate": 2.0})
    assert ben.seen == {"/x": {"rate": 5.0}}


async def test_more_topics_than_one_robot_shows_are_refused_in_words(relay):
    ann, ben = Viewer(), Viewer()
    relay.set_subscriptions(ann, {f"/t{number}": 1.0 for number in range(wire.MOST_SUBSCRIPTIONS)})
    relay.set_subscriptions(ben, {"/t0": 1.0, "/one_more": 1.0})
    assert ben.seen["/one_more"]["refusal"]["code"] == "too_many_subscriptions"
    await ann.until(lambda: len(ann.seen) == wire.MOST_SUBSCRIPTIONS)
    assert ben.seen["/t0"] == {"rate": 1.0}


async def test_inspector_runs_only_while_needed_and_shortly_after(make, spawned):
    relay = make(linger_s=0.0)
    assert spawned == []
    ann, process = await started(relay, spawned)
    relay.ask(ann, question(1))  # after the lingering, while the topic is still subscribed
    assert (await ann.answer(1)).value[0] == process.pid
    relay.set_subscriptions(ann, {})
    assert await asyncio.wait_for(process.wait(), PATIENCE_S) == 0
    relay.set_subscriptions(ann, {"/y": 1.0})  # subscribe again
    await ann.until(lambda: "/y" in ann.seen)


async def test_a_question_without_an_answer_is_refused_in_time(relay, monkeypatch):
    ann = Viewer()
    relay.ask(ann, question(1))
    await ann.answer(1)
    monkeypatch.setattr(inspector_client, "ANSWER_S", 0.05)
    relay.ask(ann, question(2, "/silent"))
    refused = await ann.answer(2)
    assert (refused.of, refused.refusal.code, refused.seq) == ("parameter", "inspector_silent", 1002)


async def test_too_many_questions_at_once_are_refused(relay):
    ann = Viewer()
    for seq in range(MAX_QUERIES + 1):
        relay.ask(ann, question(seq))
    assert (await ann.answer(MAX_QUERIES)).refusal.code == "busy"
    await ann.answer(MAX_QUERIES - 1)
    relay.ask(ann, question(MAX_QUERIES + 1))
    assert (await ann.answer(MAX_QUERIES + 1)).value


@pytest.mark.parametrize("how", ["/die", "/babble"])
async def test_broken_inspector_is_replaced_with_same_subscriptions(relay, monkeypatch, how):
    monkeypatch.setattr(line_process, "RESTART_S", (0.01, 0.05))
    monkeypatch.setattr(line_process, "END_S", 0.5)
    ann = Viewer()
    relay.set_subscriptions(ann, {"/x": 1.0})
    relay.ask(ann, question(1))
    first = (await ann.answer(1)).value
    ann.seen.clear()
    relay.ask(ann, question(2, how))
    await ann.until(lambda: "/x" in ann.seen)
    relay.ask(ann, question(3))
    assert (await ann.answer(3)).value != first


async def test_publishing_at_a_rate_is_lost_with_the_process(make, monkeypatch):
    monkeypatch.setattr(line_process, "RESTART_S", (0.01, 0.05))
    lost = asyncio.Event()
    relay = make(lost=lost.set)
    ann = Viewer()
    relay.set_subscriptions(ann, {"/published": 1.0})
    await ann.until(lambda: ann.seen)
    relay.publish(AT_A_RATE)
    await ann.until(lambda: ann.seen["/published"] == {"data": "hello"})
    ann.seen.clear()
    relay.ask(ann, question(2, "/die"))
    await asyncio.wait_for(lost.wait(), PATIENCE_S)
    assert await ann.until(lambda: ann.seen) == {"/published": {"rate": 1.0}}  # the new one does not publish


async def test_message_without_a_process_is_never_published(relay):
    assert not relay.publish(ORDER)
    assert not relay.publish(AT_A_RATE)
    ann = Viewer()
    relay.set_subscriptions(ann, {"/published": 1.0})
    assert await ann.until(lambda: ann.seen) == {"/published": {"rate": 1.0}}


async def test_fields_are_checked_before_anything_is_published(relay):
    checked: asyncio.Queue[wire.Refusal | None] = asyncio.Queue()
    for fields in ({"data": "right"}, {"data": "wrong"}):
        order = msgspec.structs.replace(ORDER, fields=fields)
        relay.check(order, lambda refusal, _now_s: checked.put_nowait(refusal))
    assert await asyncio.wait_for(checked.get(), PATIENCE_S) is None
    refusal = await asyncio.wait_for(checked.get(), PATIENCE_S)
    assert refusal is not None
    assert refusal.code == "bad_field"


async def test_a_process_that_does_not_stop_publishing_is_killed(relay, spawned, monkeypatch):
    monkeypatch.setattr(inspector_client, "HALT_S", 0.05)
    ann, process = await started(relay, spawned)
    relay.publish(msgspec.structs.replace(AT_A_RATE, topic="/notes"))
    relay.publish_stop("/notes")
    relay.ask(ann, question(1))
    await ann.answer(1)
    assert process.returncode is None  # it confirmed that it stopped publishing
    relay.publish(msgspec.structs.replace(AT_A_RATE, topic="/deaf"))
    relay.publish_stop("/deaf")
    assert await asyncio.wait_for(process.wait(), PATIENCE_S) in KILLED


async def test_a_process_that_reads_nothing_is_killed(relay, spawned, monkeypatch):
    monkeypatch.setattr(line_process, "LARGEST_BACKLOG", 10_000)
    ann, process = await started(relay, spawned)
    relay.ask(ann, question(1, "/doze"))
    assert relay.publish(ORDER)
    for _ in range(10):  # more than a pipe's buffer
        relay.check(msgspec.structs.replace(ORDER, fields={"data": "x" * 60_000}), lambda *_: None)
    assert not relay.publish(ORDER)
    assert await asyncio.wait_for(process.wait(), PATIENCE_S) in KILLED


async def test_every_query_is_refused_if_the_program_cannot_start(make, monkeypatch):
    monkeypatch.setattr(inspector_client, "START_S", 0.1)
    relay = make(command=("/nowhere/inspector",))
    ann = Viewer()
    relay.ask(ann, question(1))
    assert (await ann.answer(1)).refusal.code == "inspector_silent"


async def test_with_the_bridge_its_inspector_ends(make, spawned):
    relay = make()
    _, process = await started(relay, spawned)
    await relay.close()
    assert process.returncode == 0


async def test_inspector_in_its_start_ends_with_the_bridge(make, spawned):
    relay = make()
    relay.ask(Viewer(), question(1, "/doze"))
    await asyncio.sleep(0)  # the start of the process begins
    assert spawned == []
    await asyncio.wait_for(relay.close(), PATIENCE_S)
    assert [process.returncode is None for process in spawned] == [False]


@pytest.mark.parametrize("rate_hz", [1e-300, 0.05, 0.0, 11.0])
def test_subscription_rates_have_a_lower_limit(rate_hz):
    subscribe = f'{{"t":"subscribe","topic":"/odom","rate_hz":{rate_hz}}}'
    subscribed = f'{{"t":"subscribed","topics":{{"/odom":{rate_hz}}}}}'
    for door, raw in ((wire.topics_message, subscribe), (wire.link_request, subscribed)):
        with pytest.raises(wire.WireError):
            door(raw)
