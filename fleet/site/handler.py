"""Django's handler, with one change of thread for each request."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

from asgiref.sync import sync_to_async
from django.core.handlers.asgi import ASGIHandler
from django.db import close_old_connections
from django.http import HttpRequest
from django.http.response import HttpResponseBase

from fleet.accounts.sign_in.hashing import MOST_WAITING
from robots.processes.scheduling import prefer_stop_thread
from teleop.api.v1.door.later import Later

P = ParamSpec("P")
R = TypeVar("R")


class OneThreadHandler(ASGIHandler):
    """Run middleware and view, which are all synchronous here, in one call on one thread.

    Django's own handler calls them by way of the event loop: the request waits there three times for drive input and
    other requests. A stop by HTTP took twice as long.
    """

    def load_middleware(self, is_async: bool = False) -> None:
        """Load the chain of middleware for a thread."""
        super().load_middleware(is_async=False)

    async def get_response_async(self, request: HttpRequest) -> HttpResponseBase:
        """Answer the request on its thread."""
        return await sync_to_async(self._answer)(request)

    def _answer(self, request: HttpRequest) -> HttpResponseBase:
        prefer_stop_thread()  # the process that drives answers stops alone; the pages process may prefer nobody
        return self.get_response(request)


class PagesHandler(OneThreadHandler):
    """For the pages process: `THREADS` threads, which keep their database connections for the next request.

    With a thread and a connection for each of fifty requests at once, all of them take longer.
    """

    THREADS = MOST_WAITING + 8  # sign-ins that wait for their turn leave eight for other pages

    def __init__(self) -> None:
        super().__init__()
        self._threads = ThreadPoolExecutor(self.THREADS, thread_name_prefix="page")

    async def get_response_async(self, request: HttpRequest) -> HttpResponseBase:
        """Answer the request on one of the threads. An answer that waits for news holds none meanwhile."""
        response = await self._on_a_thread(self._answer)(request)
        if isinstance(response, Later):
            await response.wait()
            await self._on_a_thread(_renewed)(response)
        return response

    def _on_a_thread(self, call: Callable[P, R]) -> Callable[P, Coroutine[Any, Any, R]]:
        return sync_to_async(call, thread_sensitive=False, executor=self._threads)

    def _answer(self, request: HttpRequest) -> HttpResponseBase:
        close_old_connections()
        try:
            return self.get_response(request)
        finally:
            close_old_connections()


def _renewed(response: Later) -> None:
    close_old_connections()
    try:
        response.renew()
    finally:
        close_old_connections()
