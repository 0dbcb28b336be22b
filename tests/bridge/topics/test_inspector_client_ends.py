"""Requests to the inspector end in time: halted, without the bridge, too late, or with the inspector."""

from __future__ import annotations

import asyncio
import os
import sys
import textwrap
import time
from types import SimpleNamespace

import msgspec
import pytest

from robots.bridge.topics import inspector_client, line_process
from robots.bridge.topics.inspector_messages import InspectorQuery, TooLate
from robots.shared import wire
from tests.bridge.tasks.test_publishing import bench, note, settled
from tests.bridge.topics.test_inspector_client import (
    AT_A_RATE,
    ORDER,
    PATIENCE_S,
    Viewer,
    make,
    question,
    spawned,
)

__all__ = ["bench", "make", "spawned"]  # fixtures

# An inspector that reports each line it receives, answers queries for names, and may confirm halts.
PROGRAM = textwrap.dedent("""
    import json, sys, time

    def say(**report):
        print(json.dumps(report), flush=True)

    config = json.loads(sys.stdin.readline())
    {begin}
    say(t="ready")
    for line in sys.stdin:
        request = json.loads(line)
        say(t="link_sample", topic="/heard", sample=request)
        if request["t"] == "halt_publishing" and {confirms}:
            say(t="done", number=request["number"], refusal=None)
        if request["t"] == "inspect" and "name" in request["ask"]:
            answer = {{"t": "parameter_value", "name": request["ask"]["name"], "value": None}}
            say(t="inspected", seq=request["seq"], answer=answer)
    {end}
""")


class Ear(Viewer):
    """A viewer that stores the lines that the inspector receives."""

    def __init__(self) -> None:
        super().__init__()
        self.heard: list[dict[str, object]] = []

    def show_sample(self, topic: str, seen: bytes) -> None:
        super().show_sample(topic, seen)
        self.heard.append(self.seen[topic])

    def kinds(self) -> list[object]:
        return [line["t"] for line in self.heard]

    async def hears(self, kind: str) -> dict[str, object]:
        """The first line of that kind."""
        await self.until(lambda: kind in self.kinds())
        return next(line for line in self.heard if line["t"] == kind)


def program(begin="", end="", confirms=True):
    return sys.executable, "-c", PROGRAM.format(begin=begin, end=end, confirms=confirms)


@pytest.fixture
async def listen(make):
    """`listen(begin, end)`: a client and a viewer; the inspector runs these lines at its begin and end."""

    async def started(begin="", end="", confirms=True, **changes):
        command = program(begin, end, confirms)
        relay, ear = make(**({"command": command} | changes)), Ear()
        relay.set_subscriptions(ear, {"/heard": 10.0})
        return relay, ear

    return started


@pytest.fixture
async def talk(listen):
    """A client and a viewer, after the inspector has started."""
    relay, ear = await listen()
    await ear.hears("subscribed")
    return relay, ear


CALL = wire.CallService("/lamp", {"data": True}, seq=9)


# --- halt -----------------------------------------------------------------------------------------


async def test_halt_after_a_single_message_is_sent_exactly_once(talk):
    relay, ear = talk
    relay.halt()
    relay.publish(ORDER)
    relay.halt()
    relay.halt()
    relay.ask(ear, question(1))
    await ear.answer(1)
    assert ear.kinds() == ["subscribed", "publish", "halt_publishing", "inspect"]
    assert ear.heard[2]["topic"] is None


async def test_an_inspector_that_does_not_confirm_a_halt_is_killed(listen, spawned, monkeypatch):
    monkeypatch.setattr(inspector_client, "HALT_S", 0.05)
    relay, ear = await listen(confirms=False)
    await ear.hears("subscribed")
    [process] = spawned
    relay.publish(ORDER)
    relay.halt()
    assert await asyncio.wait_for(process.wait(), PATIENCE_S) == -9


@pytest.mark.parametrize(
    "end",
    [
        lambda bench: bench.core.stop("Bob", "", bench.now_s),
        lambda bench: bench.core.revoke(1, "over", bench.now_s),
        lambda bench: bench.granted(2),
        lambda bench: (bench.core.link_lost(1, bench.now_s), bench.pass_time(2.5)),
    ],
    ids=["stop", "end of control", "another holder", "lost link"],
)
def test_halt_includes_messages_published_once(bench, end):
    bench.order(note())
    settled(bench)
    assert bench.publisher.halts == 0
    end(bench)
    assert bench.publisher.halts > 0


# --- keep alive -----------------------------------------------------------------------------------


async def test_keep_alive_is_for_publishing_at_a_rate(talk):
    relay, ear = talk
    relay.publish(ORDER)
    relay.keep_alive()
    relay.publish(AT_A_RATE)
    relay.keep_alive()
    relay.publish_stop(AT_A_RATE.topic)
    relay.keep_alive()
    relay.ask(ear, question(1))
    await ear.answer(1)
    assert ear.kinds() == ["subscribed", "publish", "publish", "alive", "halt_publishing", "inspect"]


def test_keep_alive_is_sent_each_tick_while_publishing_at_rate(bench):
    bench.pass_time(0.2)
    assert bench.publisher.kept_alive == 0
    bench.order(note(5.0))
    settled(bench)
    before = bench.publisher.kept_alive
    bench.pass_time(1.0)
    assert bench.publisher.kept_alive - before == 20
    bench.core.stop("Bob", "", bench.now_s)
    before = bench.publisher.kept_alive
    bench.pass_time(0.2)
    assert bench.publisher.kept_alive == before


# --- too late -------------------------------------------------------------------------------------


async def test_timed_out_request_is_not_sent_to_a_later_process(listen, monkeypatch):
    monkeypatch.setattr(inspector_client, "START_S", 0.05)
    monkeypatch.setattr(line_process, "RESTART_S", (0.2, 0.2))
    command = ["/nowhere/inspector"]
    relay, ear = await listen(command=command)
    relay.ask(ear, wire.LinkQuery(1, CALL))
    refusal = (await ear.answer(1)).refusal
    assert refusal.code == "inspector_silent"
    assert refusal.text.endswith("ask again.")
    monkeypatch.setattr(inspector_client, "START_S", PATIENCE_S)
    command[:] = program()
    relay.ask(ear, question(2))
    await ear.answer(2)
    assert [line["ask"]["t"] for line in ear.heard if line["t"] == "inspect"] == ["parameter"]


async def test_timed_out_call_has_an_unknown_result(talk, monkeypatch):
    relay, ear = talk
    monkeypatch.setattr(inspector_client, "ANSWER_S", 0.05)
    for seq, ask in enumerate((CALL, wire.SetParameter("/silent", 1)), 1):
        relay.ask(ear, wire.LinkQuery(seq, ask))
    assert (await ear.answer(1)).refusal.text.endswith("it is unknown whether this was carried out.")


async def test_query_carries_its_time_limit(talk, monkeypatch):
    relay, ear = talk
    monkeypatch.setattr(inspector_client, "ANSWER_S", 3.0)
    before_s = time.monotonic()
    relay.ask(ear, question(1))
    await ear.answer(1)
    asked = msgspec.convert(await ear.hears("inspect"), InspectorQuery)
    assert before_s + 3.0 <= asked.until_s <= time.monotonic() + 3.0
    asked.require_time()
    with pytest.raises(TooLate):
        msgspec.structs.replace(asked, until_s=time.monotonic()).require_time()


# --- end of the inspector -------------------------------------------------------------------------


async def test_query_to_an_ending_inspector_goes_to_the_next(listen, spawned, monkeypatch, tmp_path):
    monkeypatch.setattr(line_process, "RESTART_S", (600.0, 600.0))
    monkeypatch.setattr(line_process, "END_S", PATIENCE_S)
    monkeypatch.setattr(inspector_client, "ANSWER_S", 0.0)  # too short for an answer of the ending process
    may_end = tmp_path / "may end"
    os.mkfifo(may_end)
    relay, ear = await listen(end=f"open({str(may_end)!r}).read()", linger_s=0.0)
    await ear.hears("subscribed")
    [process] = spawned
    relay.set_subscriptions(ear, {})
    await asyncio.sleep(0.01)  # it lingers for no time: now its input is closed
    assert process.returncode is None
    relay.ask(ear, question(1))
    await asyncio.to_thread(may_end.write_bytes, b"")
    assert (await ear.answer(1)).name == "/a"
    assert process.returncode == 0
    may_end.unlink()
    may_end.touch()  # the next process may end at any time


async def test_pauses_before_restarts_grow_from_the_shortest(monkeypatch):
    pauses, over = [], asyncio.Event()

    async def pause(ended, seconds):
        ended.close()
        pauses.append(seconds)
        if len(pauses) == 3:
            over.set()

    monkeypatch.setattr(line_process, "RESTART_S", (0.1, 60.0))
    monkeypatch.setattr(line_process.asyncio, "wait_for", pause)
    owner = SimpleNamespace(needed=lambda: len(pauses) < 3)
    child = line_process.LineProcess(("/nowhere/inspector",), b"", owner)
    child.need()
    await over.wait()
    await child.close()
    assert pauses == [0.1, 0.2, 0.4]
