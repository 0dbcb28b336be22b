"""Django behind ASGI: its own WSGI application, each request in one call on one thread.

Signals, middleware and views are all synchronous here. Django's ASGI handler returns to the event loop between them,
and makes a thread and a database connection for each request: `docs/decisions/public-interfaces.md` has the figures.
"""

from __future__ import annotations

import asyncio
import logging
import sys
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, asynccontextmanager, nullcontext
from io import BytesIO
from typing import Any

from asgiref.sync import sync_to_async
from django.core.wsgi import get_wsgi_application
from django.db import close_old_connections
from django.http import FileResponse

from fleet.site import sign_in_queue
from fleet.site.pages.unavailable import TOO_MANY_SIGN_INS
from fleet.site.sign_in_queue import QueueFull, SignInQueue, queued
from robots.shared.processes.scheduling import ask_for_stop_priority
from robots.shared.wire import NotDone
from teleop.api.v1.framework.long_poll import LongPoll

PIECE_BYTES = 65536  # of a file

log = logging.getLogger(__name__)

# Not the one thread of all other synchronous work: a disk or a store of recordings may not answer for seconds
file_readers = ThreadPoolExecutor(8, "file")


class OneThreadHandler:
    """ASGI application: the answers of Django's WSGI application."""

    THREADS = 3

    def __init__(self) -> None:
        self._django: Any = get_wsgi_application()
        # Not the thread of all other synchronous work, such as handshakes of WebSockets: an answer would wait for it.
        # The threads of the web process answer stops; in the pages process the priority has no effect.
        self._threads = ThreadPoolExecutor(self.THREADS, "answer", initializer=ask_for_stop_priority)

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Answer the request.

        If the client leaves, drop a request that waits for its thread, and end a stream.
        """
        body = await _body(receive)
        if body is None:
            return
        answering = asyncio.ensure_future(self._answer(_environ(scope, body), send))
        leaving = asyncio.ensure_future(_left(receive))
        try:
            await asyncio.wait({answering, leaving}, return_when=asyncio.FIRST_COMPLETED)
        finally:  # also when the server ends: an export records its end
            answering.cancel()
            leaving.cancel()
            await asyncio.gather(answering, leaving, return_exceptions=True)
        if not answering.cancelled():
            answering.result()

    async def _answer(self, environ: dict[str, Any], send: Any) -> None:
        response = await self.on_thread(self._respond, environ)
        if isinstance(response, LongPoll):
            await response.wait()
            await self.on_thread(_renew, response)
        try:
            await _send(response, send)
        finally:
            if response.streaming:
                await sync_to_async(response.close)()

    def _respond(self, environ: dict[str, Any]) -> Any:
        """Return the response. It is closed, unless its content is still to be streamed."""
        response: Any = self._django(environ, lambda *_: None)
        if not response.streaming:
            response.close()
        return response

    async def on_thread(self, call: Callable[..., Any], *arguments: Any) -> Any:
        """Make a call on a thread, and return its result."""
        async with self._place():
            return await sync_to_async(call, thread_sensitive=False, executor=self._threads)(*arguments)

    def _place(self) -> AbstractAsyncContextManager[None]:
        return nullcontext()


class PagesHandler(OneThreadHandler):
    """The handler of the pages process, with its own threads, which keep their database connections.

    At most `AT_ONCE` requests run at a time, besides slow ones: the more threads share the interpreter, the
    longer each request takes. A request that takes longer than `SLOW_S` mostly waits for a robot, or for the
    hash of a password.
    """

    AT_ONCE = 8
    SLOW_S = 0.25
    # Even if sign-ins and robots keep many busy, pages have `AT_ONCE`
    THREADS = 20 + sign_in_queue.AT_ONCE + sign_in_queue.OWN_AT_ONCE + AT_ONCE

    def __init__(self) -> None:
        super().__init__()
        self._places = asyncio.Semaphore(self.AT_ONCE)
        self._sign_ins = SignInQueue()

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Answer the request; one with a password when it is its turn."""
        if (place := self._sign_ins.place(scope)) is not None:
            headers = [(b"content-type", b"application/json"), (b"cache-control", b"no-store")]
            await send({"type": "http.response.start", "status": 200, "headers": headers})
            await send({"type": "http.response.body", "body": place})
            return
        await super().__call__(scope, receive, send)

    async def _answer(self, environ: dict[str, Any], send: Any) -> None:
        if not queued(environ):
            await super()._answer(environ, send)
            return
        try:
            async with self._sign_ins.turn(environ):
                await _to_the_end(asyncio.ensure_future(super()._answer(environ, send)))
        except QueueFull:
            await super()._answer({**environ, TOO_MANY_SIGN_INS: "1"}, send)

    @asynccontextmanager
    async def _place(self) -> AsyncIterator[None]:
        await self._places.acquire()
        slow = asyncio.get_running_loop().call_later(self.SLOW_S, self._places.release)
        try:
            yield
        finally:
            if asyncio.get_running_loop().time() < slow.when():
                slow.cancel()
                self._places.release()


async def _body(receive: Any) -> bytes | None:
    """Return the body of a request; None: the client has left before its end."""
    parts = []
    while (event := await receive())["type"] == "http.request":
        parts.append(event.get("body", b""))
        if not event.get("more_body"):
            return b"".join(parts)
    return None


async def _to_the_end(work: asyncio.Future[None]) -> None:
    """Wait for work, even if the client leaves: its thread goes on, so the next may not begin yet."""
    try:
        await asyncio.shield(work)
    finally:
        await asyncio.gather(work, return_exceptions=True)


async def _left(receive: Any) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass


def _environ(scope: dict[str, Any], body: bytes) -> dict[str, Any]:
    """Return a request as WSGI has it (PEP 3333). `environ` of the scope is added."""
    host, port = scope.get("server") or ("unknown", 0)
    environ = {
        **scope.get("environ", {}),
        "REQUEST_METHOD": scope["method"],
        "SCRIPT_NAME": scope.get("root_path", "").encode().decode("latin-1"),
        "PATH_INFO": scope["path"].encode().decode("latin-1"),
        "QUERY_STRING": scope["query_string"].decode("latin-1"),
        "SERVER_NAME": str(host),
        "SERVER_PORT": str(port),
        "SERVER_PROTOCOL": f"HTTP/{scope['http_version']}",
        "CONTENT_LENGTH": str(len(body)),
        "wsgi.version": (1, 0),
        "wsgi.url_scheme": scope["scheme"],
        "wsgi.input": BytesIO(body),
        "wsgi.errors": sys.stderr,
        "wsgi.multithread": True,
        "wsgi.multiprocess": True,
        "wsgi.run_once": False,
    }
    if scope.get("client"):
        environ["REMOTE_ADDR"] = str(scope["client"][0])
    for name, value in scope["headers"]:
        key = name.decode("latin-1").upper().replace("-", "_")
        if key == "CONTENT_TYPE":
            environ[key] = value.decode("latin-1")
        elif key != "CONTENT_LENGTH":
            others = environ.get(f"HTTP_{key}")
            separator = "; " if key == "COOKIE" else ","
            text = value.decode("latin-1")
            environ[f"HTTP_{key}"] = text if others is None else f"{others}{separator}{text}"
    return environ


async def _send(response: Any, send: Any) -> None:
    headers = [(name.encode("ascii"), value.encode("latin-1")) for name, value in response.items()]
    headers += [
        (b"Set-Cookie", cookie.output(header="").strip().encode("ascii"))
        for cookie in response.cookies.values()
    ]
    await send({"type": "http.response.start", "status": response.status_code, "headers": headers})
    if response.streaming:
        try:
            async for part in _parts(response):
                await send({"type": "http.response.body", "body": part, "more_body": True})
        except (NotDone, OSError) as error:  # without an end, the client sees that it has not got all
            log.warning("An answer breaks off: %s", error)
            return
        await send({"type": "http.response.body"})
    else:
        await send({"type": "http.response.body", "body": response.content})


async def _parts(response: Any) -> AsyncIterator[bytes]:
    if response.is_async:
        async for part in response:
            yield part
        return
    parts = iter(response)
    following = sync_to_async(lambda: next(parts, None))
    if isinstance(response, FileResponse):
        response.block_size = PIECE_BYTES
        following = sync_to_async(lambda: next(parts, None), thread_sensitive=False, executor=file_readers)
    while (part := await following()) is not None:
        yield part


def _renew(response: LongPoll) -> None:
    close_old_connections()
    try:
        response.renew()
    finally:
        close_old_connections()
