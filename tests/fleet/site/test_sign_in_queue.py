"""Requests with passwords: a few run at once, the others wait and can ask for their place."""

import asyncio
import json

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
