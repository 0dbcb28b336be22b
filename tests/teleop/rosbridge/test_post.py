"""The post of a robot's clients between web processes: two in one process, by the channel layer."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any
from uuid import uuid4

import pytest
import pytest_asyncio

from robots.shared.wire import NotDone
from teleop.background import channel_group
from teleop.rosbridge.clients import post
from teleop.rosbridge.clients.letters import Address, Answer, Call, Gone, Letter, Offer, Shown
from teleop.rosbridge.clients.post import Post

ADD = "/fleet/clients/add"


class Person:
    """A client of one web process; `heard`: its letters."""

    def __init__(self, post: Post, name: str) -> None:
        self.post = post
        self.heard: asyncio.Queue[tuple[Address, Letter]] = asyncio.Queue()
        self.address = post.join(name, dict.fromkeys((Call, Answer, Shown, Gone), self._hear))

    async def _hear(self, by: Address, letter: Any) -> None:
        self.heard.put_nowait((by, letter))

    async def hears(self) -> tuple[Address, Letter]:
        return await asyncio.wait_for(self.heard.get(), 10.0)


@pytest_asyncio.fixture
async def people(monkeypatch) -> AsyncIterator[Callable[[], Awaitable[tuple[Person, Person]]]]:
    """Two clients of a robot at two web processes, which know of each other."""
    monkeypatch.setattr(post, "TELL_S", 0.05)
    monkeypatch.setattr(post, "CLOSE_S", 0.1)
    robot = uuid4()
    ann, ben = Person(Post(robot), "ann"), Person(Post(robot), "ben")
    await until(lambda: ann.post._peers and ben.post._peers)
    yield ann, ben
    for person in (ann, ben):
        person.post.leave(person.address.client)
    await until(lambda: not (ann.post._tasks or ben.post._tasks))


async def until(holds: Callable[[], Any]) -> None:
    end_s = time.monotonic() + 10.0
    while not holds():
        assert time.monotonic() < end_s
        await asyncio.sleep(0.01)


async def test_a_call_and_its_answer_pass_between_processes(people):
    ann, ben = people
    ann.post.offer(Offer("service", ADD, "lab_srvs/Add", "ann"))
    await until(lambda: ben.post.find("service", ADD))
    offer, server = ben.post.find("service", ADD)
    assert (offer.type, server) == ("lab_srvs/Add", ann.address)
    await ben.post.send(ben.address, server, Call("1", ADD, {"a": 2**60, "words": "Grüß"}))
    assert await ann.hears() == (ben.address, Call("1", ADD, {"a": 2**60, "words": "Grüß"}))
    await ann.post.send(ann.address, ben.address, Answer("1", {"sum": 3}))
    assert await ben.hears() == (ann.address, Answer("1", {"sum": 3}))
    ann.post.take_back("service", ADD)
    await until(lambda: not ben.post.find("service", ADD))


async def test_a_message_of_a_topic_reaches_all_once(people):
    ann, ben = people
    other = Person(ben.post, "carl")
    await ann.post.show(ann.address, Shown(f"{ADD}/status", {}))
    await ann.post.show(ann.address, Shown(f"{ADD}/result", {}))
    for person in (ann, ben, other):
        topics = [(await person.hears())[1].topic for _ in range(2)]
        assert topics == [f"{ADD}/status", f"{ADD}/result"]
        assert person.heard.empty()
    ben.post.leave("carl")


async def test_a_call_to_a_client_that_left_is_answered(people):
    ann, ben = people
    await ben.post.send(ben.address, Address(ann.address.process, "carl"), Call("1", ADD, {}))
    _, answer = await ben.hears()
    assert answer.refusal.code == "client_left"


async def test_a_process_that_falls_silent_is_gone_with_its_offers(people, monkeypatch):
    ann, ben = people
    ann.post.offer(Offer("service", ADD, "lab_srvs/Add", "ann"))
    await until(lambda: ben.post.find("service", ADD))
    monkeypatch.setattr(post, "GONE_S", 0.2)
    for task in ann.post._tasks:  # as when it is killed
        task.cancel()
    assert await ben.hears() == (Address(ann.address.process, ""), Gone(ann.address.process))
    assert ben.post.find("service", ADD) is None
    await ben.post.send(ben.address, ann.address, Call("1", ADD, {}))  # lost; who asks gives up
    ann.post._tasks = []


async def test_letters_that_are_not_sent_are_limited(people):
    ann, ben = people
    with pytest.raises(NotDone) as refused:
        for number in range(post.MOST_WAITING + 1):  # nothing is sent meanwhile
            await ann.post.send(ann.address, ben.address, Call(str(number), ADD, {}))
    assert refused.value.refusal.code == "busy"


async def test_a_layer_that_is_away_is_logged_once_until_it_is_back(monkeypatch, caplog):
    tries, twice = 0, asyncio.Event()

    class Layer:
        async def new_channel(self) -> str:
            return "channel"

        async def group_add(self, _group: str, _channel: str) -> None:
            nonlocal tries
            tries += 1
            if tries % 4:
                raise OSError("away")

        async def receive(self, _channel: str) -> dict[str, Any]:
            if tries == 8:
                twice.set()
            raise OSError("away")

        async def group_discard(self, _group: str, _channel: str) -> None:
            pass

    monkeypatch.setattr(channel_group, "get_channel_layer", Layer)
    monkeypatch.setattr(channel_group, "_RETRY_S", 0.0)
    receiving = asyncio.create_task(channel_group.keep_receiving("robot", lambda _event: asyncio.sleep(0.0)))
    await asyncio.wait_for(twice.wait(), 10.0)
    receiving.cancel()
    assert len(caplog.messages) == 3  # at first, and each time that it goes away again
