"""Calls on threads outlive their test: a cancelled `await` leaves its thread at work in the database."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any
from weakref import WeakSet

import pytest
from django.db import connections
from django.db.backends.base.base import BaseDatabaseWrapper
from django.db.backends.signals import connection_created

from teleop.background import database
from tests.processes import PATIENCE_S, until

POOLS = (database._threads, database._background_thread)


class LateCalls:
    """The calls of one test on all executors, and the connections that its threads open."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._calls: list[Future[Any]] = []
        self._opened: WeakSet[BaseDatabaseWrapper] = WeakSet()
        patch.setattr(ThreadPoolExecutor, "submit", self._noted(ThreadPoolExecutor.submit))
        connection_created.connect(self._note)

    def end(self) -> None:
        """Wait for all calls, also those that a call makes, and for transactions of other threads."""
        deadline_s = time.monotonic() + PATIENCE_S
        while working := [call for call in self._calls if not call.done()]:
            wait(working, deadline_s - time.monotonic())
            assert time.monotonic() < deadline_s, f"calls still run: {threading.enumerate()}"
        until(
            lambda: not any(opened.in_atomic_block for opened in self._opened), "no transaction on a thread"
        )

    def _noted(self, submit: Callable[..., Future[Any]]) -> Callable[..., Future[Any]]:
        @functools.wraps(submit)
        def noted(*args: Any, **kwargs: Any) -> Future[Any]:
            self._calls.append(call := submit(*args, **kwargs))
            return call

        return noted

    def _note(self, connection: BaseDatabaseWrapper, **_: Any) -> None:
        if threading.current_thread() is not threading.main_thread():  # this one has the test's transaction
            self._opened.add(connection)


def close_connections() -> None:
    """Forget this thread's connections and those of the pools' threads: the next test has another database."""
    _forget()
    for pool in POOLS:
        together = threading.Barrier(pool._max_workers)  # so that each thread gets one call
        wait([pool.submit(_forget_with, together) for _ in range(pool._max_workers)], PATIENCE_S)


def _forget_with(others: threading.Barrier) -> None:
    others.wait(PATIENCE_S)
    _forget()


def _forget() -> None:
    for alias in list(connections):
        if hasattr(connections._connections, alias):
            connections[alias].close()
            del connections[alias]
