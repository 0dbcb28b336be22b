"""The pages process runs few requests at once, and slow ones do not delay the others."""

import asyncio
import threading

import pytest
from asgiref.sync import sync_to_async
from django.http import FileResponse, HttpResponse

from fleet.site.handler import PagesHandler, _send
from robots.shared.wire import NotDone, Refusal


@pytest.fixture
def handler():
    return PagesHandler()


async def test_few_requests_run_at_once(handler):
    running, most, lock = 0, 0, threading.Lock()
    all_places_taken = threading.Event()

    def answer():
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
            if running == handler.AT_ONCE:
                all_places_taken.set()
        assert all_places_taken.wait(10.0)
        with lock:
            running -= 1
        return HttpResponse()

    handler.SLOW_S = 60.0
    await asyncio.gather(*(handler.on_thread(answer) for _ in range(3 * handler.AT_ONCE)))
    assert most == handler.AT_ONCE


async def test_slow_requests_do_not_hold_up_others(handler):
    end = threading.Event()
    slow = [asyncio.ensure_future(handler.on_thread(end.wait, 30.0)) for _ in range(handler.AT_ONCE)]
    assert await asyncio.wait_for(handler.on_thread(lambda: "answered"), 10.0) == "answered"
    assert not any(one.done() for one in slow)
    end.set()
    assert await asyncio.gather(*slow) == [True] * handler.AT_ONCE
    assert handler._places._value == handler.AT_ONCE


async def test_a_client_that_leaves_gives_its_place_back(handler):
    handler.SLOW_S = 60.0
    end = threading.Event()
    running = [asyncio.ensure_future(handler.on_thread(end.wait, 30.0)) for _ in range(handler.AT_ONCE)]
    waiting = asyncio.ensure_future(handler.on_thread(lambda: "never"))
    await asyncio.sleep(0)
    waiting.cancel()
    for one in running:
        one.cancel()
    await asyncio.gather(*running, waiting, return_exceptions=True)
    end.set()
    assert await asyncio.wait_for(handler.on_thread(lambda: "answered"), 10.0) == "answered"


async def test_a_file_that_hangs_holds_up_no_other_work(handler):
    end = threading.Event()

    class Hanging:
        name = "file"

        def __init__(self):
            self.left = [b"rest", b"begin"]

        def read(self, _size):
            if len(self.left) == 1:
                assert end.wait(30.0)
            return self.left.pop() if self.left else b""

        def close(self):
            pass

    sent, begun = [], asyncio.Event()

    async def send(event):
        sent.append(event)
        if "body" in event:
            begun.set()

    answering = asyncio.ensure_future(_send(FileResponse(Hanging()), send))
    await begun.wait()
    assert await asyncio.wait_for(sync_to_async(lambda: "answered")(), 10.0) == "answered"
    assert not answering.done()
    end.set()
    await answering
    assert [event.get("body") for event in sent[1:]] == [b"begin", b"rest", None]


async def test_a_file_that_breaks_off_leaves_an_answer_without_an_end(handler):
    class Broken:
        name = "file"

        def read(self, _size):
            raise NotDone(Refusal("store_away", "The store is away.", "robot"))

        def close(self):
            pass

    sent = []

    async def send(event):
        sent.append(event)

    await _send(FileResponse(Broken()), send)
    assert [event["type"] for event in sent] == ["http.response.start"]
