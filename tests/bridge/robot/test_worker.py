"""Requests to a robot outside the control loop's thread."""

from __future__ import annotations

import queue
import threading
import time

from robots.bridge.robot.worker import RateLimit, Worker


def test_repeated_requests_run_now_and_once_more_later():
    done: queue.SimpleQueue[float] = queue.SimpleQueue()
    seldom = RateLimit(lambda: done.put(time.monotonic()), 0.5)
    began_s = time.monotonic()
    for _ in range(100):
        seldom.do()
    _, second_s = done.get(timeout=10), done.get(timeout=10)
    assert second_s - began_s >= 0.5
    assert done.empty()


def test_an_errand_that_fails_keeps_no_other_from_being_done():
    def fails() -> None:
        raise TypeError("of what a master answered")

    done = threading.Event()
    worker = Worker("test")
    worker.do(fails)
    worker.do(done.set)
    assert done.wait(10)
