"""Django's handler, changed so that each request changes threads only once."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

from asgiref.sync import sync_to_async
from django.core.exceptions import BadRequest, RequestAborted
from django.core.handlers.asgi import ASGIHandler, ASGIRequest, get_script_prefix
from django.core.signals import request_started
from django.db import close_old_connections
from django.http import FileResponse
from django.urls import set_script_prefix

from fleet.accounts.sign_in.hashing import MOST_WAITING
from robots.shared.processes.scheduling import ask_for_stop_priority
from teleop.api.v1.framework.long_poll import LongPoll

P = ParamSpec("P")
R = TypeVar("R")


class FormRequest(ASGIRequest):
    """A request whose form is refused once: the page that says so reads the form again."""

    def _load_post_and_files(self) -> None:
        try:
            super()._load_post_and_files()
        except BadRequest:  # a form in another encoding than UTF-8
            self._mark_post_parse_error()  # type: ignore[attr-defined]  # not in the stubs
            raise


class OneThreadHandler(ASGIHandler):
    """Run signals, middleware and view, which are all synchronous here, in one call on one thread.

    Django's own handler returns to the event loop between them: a request waits there five times for drive
    input and other requests. An answer to a stop took twice as long.
    """

    THREADS = 3
    request_class = FormRequest

    def load_middleware(self, is_async: bool = False) -> None:
        """Load the chain of middleware for a thread."""
        super().load_middleware(is_async=False)

    async def handle(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer the request.

        If the client leaves, drop a request that waits for its thread, and end a stream.
        """
        try:
            body = await self.read_body(receive)
        except RequestAborted:
            return
        with body:
            answering = asyncio.ensure_future(self._respond(scope, body, send))
            leaving = asyncio.ensure_future(self.listen_for_disconnect(receive))
            try:
                await asyncio.wait({answering, leaving}, return_when=asyncio.FIRST_COMPLETED)
            finally:  # also when the server ends: an export records its end
                answering.cancel()
                leaving.cancel()
                await asyncio.gather(answering, leaving, return_exceptions=True)
        if not answering.cancelled():
            answering.result()

    async def _respond(self, scope: Any, body: Any, send: Any) -> None:
        response = await self._on_a_thread(self._answer)(scope, body)
        if isinstance(response, LongPoll):
            await response.wait()
            await self._on_a_thread(_renew)(response)
        try:
            await self.send_response(response, send)
        finally:
            if response.streaming:
                await sync_to_async(response.close)()

    def __init__(self) -> None:
        super().__init__()
        # Not the thread of all other synchronous work, such as handshakes of WebSockets: an answer would wait for it.
        self._threads = ThreadPoolExecutor(self.THREADS, thread_name_prefix="answer")

    def _on_a_thread(self, call: Callable[P, R]) -> Callable[P, Coroutine[Any, Any, R]]:
        """Return a coroutine function that makes the call on a thread."""
        return sync_to_async(call, thread_sensitive=False, executor=self._threads)

    def _answer(self, scope: Any, body: Any) -> Any:
        """Return the response. It is closed, unless its content is still to be streamed."""
        ask_for_stop_priority()  # this thread answers a stop; in the pages process this has no effect
        set_script_prefix(get_script_prefix(scope))
        request_started.send(sender=type(self), scope=scope)
        request, malformed = self.create_request(scope, body)
        response: Any = malformed if request is None else self.get_response(request)
        response._handler_class = type(self)
        if isinstance(response, FileResponse):
            response.block_size = self.chunk_size
        if not response.streaming:
            response.close()
        return response


class PagesHandler(OneThreadHandler):
    """The handler of the pages process, with its own threads, which keep their database connections.

    At most `AT_ONCE` requests run at a time, besides slow ones: the more threads share the interpreter, the
    longer each request takes. A request that takes longer than `SLOW_S` mostly waits for a robot, or for its
    turn to check a password.
    """

    AT_ONCE = 8
    SLOW_S = 0.25
    THREADS = MOST_WAITING + AT_ONCE  # even if all possible sign-ins wait, pages still have `AT_ONCE` threads

    def __init__(self) -> None:
        super().__init__()
        self._places = asyncio.Semaphore(self.AT_ONCE)

    def _on_a_thread(self, call: Callable[P, R]) -> Callable[P, Coroutine[Any, Any, R]]:
        run = super()._on_a_thread(call)

        async def in_turn(*arguments: P.args, **options: P.kwargs) -> R:
            await self._places.acquire()
            release = _Once(self._places.release)
            timer = asyncio.get_running_loop().call_later(self.SLOW_S, release)
            try:
                return await run(*arguments, **options)
            finally:
                timer.cancel()
                release()

        return in_turn


class _Once:
    """A function that makes a call only once."""

    def __init__(self, call: Callable[[], None]) -> None:
        self._call: Callable[[], None] | None = call

    def __call__(self) -> None:
        if self._call is not None:
            self._call()
        self._call = None


def _renew(response: LongPoll) -> None:
    close_old_connections()
    try:
        response.renew()
    finally:
        close_old_connections()
