"""Requests with passwords: a few run at once, the others wait and can ask for their place."""

import asyncio
import json
import threading
from contextlib import suppress

from fleet.site.handler import PagesHandler
from fleet.site.sign_in_queue import AT_ONCE, PLACE, SignInQueue


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
