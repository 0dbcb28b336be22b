"""Run the pages process, which answers every HTTP request except stops.

So pages and drive input do not share a Python interpreter.

The process that owns the port starts the pages process, starts it again when it dies, and forwards complete
requests to it over a Unix socket.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
import time
from io import BytesIO
from pathlib import Path
from typing import Any

from twisted.internet import defer, endpoints, protocol, reactor, task
from twisted.internet.error import ConnectError
from twisted.internet.interfaces import IPushProducer
from twisted.web import http
from twisted.web.client import Agent, FileBodyProducer, HTTPConnectionPool, ResponseDone
from twisted.web.http_headers import Headers
from twisted.web.iweb import IAgentEndpointFactory
from zope.interface import implementer

from fleet.base.origin import PORT_HEADER
from fleet.server import limits

log = logging.getLogger(__name__)

AGAIN_S = 0.5  # pause before it is started again
LAST_S = 6.0  # time for its end, which takes 5 s at most once it serves; then it is killed
READY_S = 30.0  # the longest time that a request waits for a process that is just starting
RETRY_S = 0.05
MOST_KEPT = 50  # idle connections to the pages process
# Shorter than the pages process keeps idle connections, so that a request seldom gets a closing connection.
# If it does, Twisted sends the request again if that does no harm.
KEPT_S = 5.0

# CONNECT is missing: after it, the pages process would read the body as separate requests.
METHODS = {b"GET", b"HEAD", b"POST", b"PUT", b"PATCH", b"DELETE", b"OPTIONS", b"TRACE"}

# These headers are for one connection only, or are set again here.
NOT_FORWARDED = {
    *(b"connection", b"keep-alive", b"proxy-connection", b"transfer-encoding", b"te", b"trailer", b"upgrade"),
    *(b"expect", b"content-length", b"daphne-root-path"),
    *(b"x-forwarded-for", b"x-forwarded-port", b"x-forwarded-proto"),
}


class Keeper:
    """Keep the pages process running: start it, also when it has died.

    It ends on request, or with this process.
    """

    def __init__(self, run_directory: Path, application: str) -> None:
        self.path = run_directory / f"web-{os.getpid()}.sock"
        # The pages process connects to this process here
        self.programs = run_directory / f"programs-{os.getpid()}.sock"
        self._application = application
        self._ending = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._life_line, self._ours = os.pipe2(os.O_CLOEXEC)
        run_directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        _tidy(run_directory)
        self._thread = threading.Thread(target=self._keep, name="pages", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """End the pages process."""
        if self._ending.is_set():
            return
        self._ending.set()
        os.close(self._ours)
        self.path.unlink(missing_ok=True)
        self.programs.unlink(missing_ok=True)

    def wait(self) -> None:
        """Wait for the end of the process, which may still write records.

        Kill it if it does not end in time.
        """
        self._thread.join(LAST_S)
        if self._thread.is_alive() and self._process is not None:
            self._process.kill()

    def _keep(self) -> None:
        while not self._ending.is_set():
            self.path.unlink(missing_ok=True)
            try:
                process = self._process = subprocess.Popen(  # noqa: S603
                    self._command(),
                    pass_fds=[self._life_line],
                    env={**os.environ, "FLEET_PROGRAMS_SOCKET": str(self.programs)},
                )
            except OSError as error:  # not enough memory, or too many processes: it may work later
                log.error("The pages process cannot be started: %s. It is tried again.", error)
            else:
                status = process.wait()
                if not self._ending.is_set():
                    log.error("The pages process ended with status %d. It is started again.", status)
            self._ending.wait(AGAIN_S)

    def _command(self) -> list[str]:
        return [
            *(sys.executable, "-m", "fleet.server.pages_server", "--life-line", str(self._life_line)),
            *("--socket", str(self.path), self._application),
        ]


def endpoint(path: Path) -> str:
    """Return the description, for Twisted, of a Unix socket that only this account can use."""
    where = str(path).replace("\\", r"\\").replace(":", r"\:")
    return f"unix:{where}:mode=600:lockfile=0"


def _tidy(run_directory: Path) -> None:
    """Remove the sockets of processes that were killed."""
    for left in [*run_directory.glob("web-*.sock"), *run_directory.glob("programs-*.sock")]:
        if not Path(f"/proc/{left.stem.split('-')[1]}").exists():
            left.unlink(missing_ok=True)


@implementer(IAgentEndpointFactory)
class _SocketFactory:
    """Let Twisted's HTTP client connect to the socket of the pages process for every URL."""

    def __init__(self, path: Path) -> None:
        self._path = str(path)

    def endpointForURI(self, _uri: Any) -> Any:
        return endpoints.UNIXClientEndpoint(reactor, self._path, timeout=5)


class Forward:
    """Forward requests to the pages process."""

    def __init__(self, path: Path) -> None:
        connections = HTTPConnectionPool(reactor)
        connections.maxPersistentPerHost = MOST_KEPT
        connections.cachedConnectionTimeout = KEPT_S
        self._agent = Agent.usingEndpointFactory(reactor, _SocketFactory(path), connections)

    def __call__(self, request: Any) -> None:
        """Forward the request to the pages process, and send its response to the client."""
        asked = defer.ensureDeferred(self._ask(request))
        gone = request.notifyFinish()
        gone.addErrback(lambda _: asked.cancel())
        asked.addErrback(lambda failure: _failed(request, failure))

    async def _ask(self, request: Any) -> None:
        body = request.content.getvalue()
        response = await self._answer(request, _headers(request), body)
        request.setResponseCode(response.code, response.phrase)
        for name, values in response.headers.getAllRawHeaders():
            if name.lower() not in NOT_FORWARDED:
                request.responseHeaders.setRawHeaders(name, values)
        if length := _length(request, response):
            request.responseHeaders.setRawHeaders(b"content-length", [length])
        passing = _Passing(request)
        response.deliverBody(passing)
        await passing.whole

    async def _answer(self, request: Any, headers: Headers, body: bytes) -> Any:
        """Return the head of the response. If the process is just starting, wait for it."""
        # A part of such a URL would be another host's name, with separate connections
        if not request.uri.startswith(b"/"):
            raise ValueError("The address is none.")
        if request.method not in METHODS:
            raise ValueError("The method is none of HTTP's for pages.")
        until_s = time.monotonic() + READY_S
        while True:
            sent = FileBodyProducer(BytesIO(body)) if body or request.method == b"POST" else None
            try:
                return await self._agent.request(request.method, b"http://pages" + request.uri, headers, sent)
            except ConnectError:
                if time.monotonic() > until_s:
                    raise
            await task.deferLater(reactor, RETRY_S)


def _headers(request: Any) -> Headers:
    headers = Headers()
    for name, values in request.requestHeaders.getAllRawHeaders():
        if name.lower() not in NOT_FORWARDED:
            headers.setRawHeaders(name, values)
    headers.removeHeader(PORT_HEADER.encode())  # no client decides it
    proxied = request.server.proxy_forwarded_address_header is not None  # then its own port is unknown
    if (port := getattr(request.getHost(), "port", None)) is not None and not proxied:
        headers.setRawHeaders(PORT_HEADER.encode(), [b"%d" % port])
    client, scheme = request.seen_from()
    if client is not None:
        headers.setRawHeaders(b"X-Forwarded-For", [client[0].encode()])
        headers.setRawHeaders(b"X-Forwarded-Proto", [scheme.encode()])
    return headers


def _length(request: Any, response: Any) -> bytes | None:
    """Return the length of the body; None: in chunks, or no body.

    For HEAD, return that of GET (Twisted returns 0).
    """
    if request.method == b"HEAD":
        lengths: list[bytes] = response.headers.getRawHeaders(b"content-length", [])
        return lengths[0] if lengths else None
    if response.code in http.NO_BODY_CODES or not isinstance(response.length, int):
        return None
    return b"%d" % response.length


def _failed(request: Any, failure: Any) -> None:
    """Refuse a request that failed: it was invalid, or the pages process died or does not start.

    A client that has left gets no answer.
    """
    if failure.check(defer.CancelledError) or request.channel is None or request.finished:
        return
    if failure.check(ValueError):  # the method or the URL is invalid
        request.channel.refuse(limits.malformed())
        return
    log.warning("The pages process did not answer %s: %s", request.path, failure.getErrorMessage())
    if request.startedWriting:
        request.channel.transport.abortConnection()
    else:
        request.channel.refuse(limits.no_answer())


@implementer(IPushProducer)
class _Passing(protocol.Protocol):  # type: ignore[misc]
    """Pass the response's body on, as fast as the client reads.

    After `UNREAD_S` without reading, disconnect.
    """

    def __init__(self, request: Any) -> None:
        self._request = request
        self._unread: Any = None  # the call that disconnects
        # If the client has left, this is cancelled, and the pages process stops sending the response.
        self.whole: Any = defer.Deferred(lambda _: self.transport.stopProducing())

    def connectionMade(self) -> None:
        self._request.registerProducer(self, True)

    def pauseProducing(self) -> None:  # may be called twice
        self.transport.pauseProducing()
        if self._unread is None:
            self._unread = reactor.callLater(limits.UNREAD_S, self._give_up)

    def resumeProducing(self) -> None:
        self._client_reads()
        self.transport.resumeProducing()

    def _give_up(self) -> None:
        self._unread = None
        self._request.channel.transport.abortConnection()

    def stopProducing(self) -> None:
        self.transport.stopProducing()

    def dataReceived(self, data: bytes) -> None:
        if not self._request.finished and self._request.channel is not None:
            self._request.write(data)

    def connectionLost(self, reason: Any = None) -> None:
        self._client_reads()
        request = self._request
        if self.whole.called:  # it was cancelled
            return
        if request._disconnected:
            self.whole.callback(None)
            return
        request.unregisterProducer()
        if reason.check(ResponseDone):
            request.finish()
            self.whole.callback(None)
        else:
            self.whole.errback(reason)

    def _client_reads(self) -> None:
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None
