"""Requests with passwords: a few run at once, the others wait and can ask for their place."""

import asyncio
import json
import threading
from contextlib import suppress

import pytest

from fleet.site.handler import PagesHandler
from fleet.site.pages.unavailable import RETRY_AFTER_S
from fleet.site.sign_in_queue import (
    AT_ONCE,
    MOST_OF_NETWORK,
    MOST_WAITING,
    OWN_AT_ONCE,
    PLACE,
    QueueFull,
    SignInQueue,
)


def sign_in(ticket="", address="10.0.0.1", path="/accounts/sign-in/", method="POST"):
    query = f"ticket={ticket}" if ticket else ""
    return {"REQUEST_METHOD": method, "PATH_INFO": path, "QUERY_STRING": query, "REMOTE_ADDR": address}


def place(queue, ticket):
    return json.loads(queue.place({"path": PLACE, "query_string": f"ticket={ticket}".encode()}))


async def test_those_who_wait_know_their_place():
    queue, end, order = SignInQueue(), asyncio.Event(), []

    async def one(ticket, **request):
        async with queue.turn(sign_in(ticket, **request)):
            order.append(ticket)
            await end.wait()

    tasks = [asyncio.ensure_future(one(str(number))) for number in range(AT_ONCE + 3)]
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert order == [str(number) for number in range(AT_ONCE)]
    assert place(queue, str(AT_ONCE + 2)) == {"ahead": 2, "waiting": 3}
    assert place(queue, "0") == {"ahead": None, "waiting": 3}
    tasks[AT_ONCE].cancel()  # the person closed the page
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert place(queue, str(AT_ONCE + 2)) == {"ahead": 1, "waiting": 2}
    async with queue.turn(sign_in(path="/healthz")), queue.turn(sign_in(method="GET")):
        pass  # no other request waits
    end.set()
    await asyncio.gather(*tasks, return_exceptions=True)
    assert place(queue, "1") == {"ahead": None, "waiting": 0}


async def test_a_network_with_many_requests_delays_only_itself():
    queue, end, order = SignInQueue(), asyncio.Event(), []

    async def one(ticket, address):
        async with queue.turn(sign_in(ticket, address)):
            order.append(ticket)
            await end.wait()

    flood = [asyncio.ensure_future(one("flood", "10.0.0.1")) for _ in range(AT_ONCE + 50)]
    await asyncio.sleep(0)
    student = asyncio.ensure_future(one("student", "10.0.0.2"))
    await asyncio.sleep(0)
    end.set()
    await asyncio.gather(*flood, student)
    assert order.index("student") <= AT_ONCE + 1


async def waiting(queue, number, address, **request):
    """Let this many requests of an address wait."""

    async def one():
        async with queue.turn(sign_in(address=address, **request)):
            await asyncio.Event().wait()

    tasks = [asyncio.ensure_future(one()) for _ in range(number)]
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    return tasks


async def test_the_queue_is_bounded_for_a_network_and_for_all():
    queue = SignInQueue()
    tasks = await waiting(queue, AT_ONCE + MOST_OF_NETWORK, "10.0.0.1")
    with pytest.raises(QueueFull):
        await queue.turn(sign_in(address="10.0.0.1")).__aenter__()
    tasks += await waiting(queue, MOST_WAITING - MOST_OF_NETWORK, "10.0.0.2")
    with pytest.raises(QueueFull):
        await queue.turn(sign_in(address="10.0.0.3")).__aenter__()
    async with queue.turn(sign_in(address="10.0.0.1", path="/accounts/password/")):
        pass  # a signed-in person waits behind no stranger
    tasks += await waiting(queue, OWN_AT_ONCE + 1, "10.0.0.4", path="/accounts/again/")
    assert place(queue, "1") == {"ahead": None, "waiting": MOST_WAITING}
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    async with queue.turn(sign_in()):
        pass


@pytest.mark.parametrize("path", ["/accounts/password/forgotten/", "/accounts/password/new/1-2/"])
async def test_strangers_have_no_turns_of_signed_in_people(path):
    queue = SignInQueue()
    tasks = await waiting(queue, AT_ONCE, "10.0.0.1")
    tasks += await waiting(queue, 1, "10.0.0.1", path=path)
    assert place(queue, "1")["waiting"] == 1
    for task in tasks:
        task.cancel()


@pytest.mark.django_db
async def test_a_full_queue_says_so_with_code_and_time(monkeypatch):
    monkeypatch.setattr("fleet.site.sign_in_queue.MOST_WAITING", 0)
    for accept, words in (("text/html", "Many people sign in"), ("application/json", '"code": "busy"')):
        events, sent = [{"type": "http.request"}], []

        async def receive(events=events):
            return events.pop() if events else await asyncio.Event().wait()

        async def send(event, sent=sent):
            sent.append(event)

        headers = [(b"accept", accept.encode()), (b"host", b"testserver")]
        scope = {"method": "POST", "path": "/accounts/sign-in/", "query_string": b"", "headers": headers}
        await PagesHandler()({**scope, "scheme": "http", "http_version": "1.1"}, receive, send)
        assert sent[0]["status"] == 503
        assert (b"Retry-After", b"%d" % RETRY_AFTER_S) in sent[0]["headers"]
        assert words in sent[1]["body"].decode()


async def test_who_leaves_keeps_the_turn_until_the_thread_is_free(monkeypatch):
    """Else a stranger who asks and leaves would occupy every thread, and no page would be answered."""
    handler, go, begun = PagesHandler(), threading.Event(), []

    def respond(environ):
        begun.append(environ)
        assert go.wait(10)
        raise RuntimeError

    async def one():
        events = iter([{"type": "http.request"}, {"type": "http.disconnect"}])

        async def receive():
            event = next(events)
            if event["type"] == "http.disconnect":
                await asyncio.sleep(0.02)
            return event

        scope = {"method": "POST", "path": "/accounts/sign-in/", "query_string": b"", "headers": []}
        with suppress(RuntimeError):
            await handler({**scope, "scheme": "http", "http_version": "1.1"}, receive, None)

    monkeypatch.setattr(handler, "_respond", respond)
    people = []
    for _wave in range(3):
        people += [asyncio.ensure_future(one()) for _ in range(AT_ONCE)]
        await asyncio.sleep(0.1)
    assert len(begun) == AT_ONCE
    go.set()
    await asyncio.gather(*people)
    async with handler._sign_ins.turn(sign_in()):
        pass  # all turns are over
