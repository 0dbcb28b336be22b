"""A client without a browser: signs in over HTTP, drives over the public WebSocket."""

from __future__ import annotations

import asyncio
import http.cookiejar
import re
import secrets
import ssl
import time
import urllib.parse
import urllib.request
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from itertools import count
from typing import Any, Protocol, Self

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from robots.shared import wire
from script.stack.stack import Account, Certificate

RENEW_BEFORE_S = 3.0  # before the end of the term
DRIVE_PERIOD_S = 0.05
ANSWER_S = 10.0
MOST_DRIVEN_S = 20.0
_CSRF = re.compile(r'name="csrfmiddlewaretoken" value="([^"]+)"')


class Console(Protocol):
    """A running console with the data that clients need, such as a `Stack`."""

    @property
    def url(self) -> str: ...
    @property
    def port(self) -> int: ...
    @property
    def hosts(self) -> Sequence[str]: ...
    @property
    def certificate(self) -> Certificate | None: ...
    @property
    def accounts(self) -> Mapping[str, Account]: ...


class SignInError(RuntimeError):
    """The console refused to sign in."""


def sign_in(console: Console, role: str) -> str:
    """Sign in with the account of `role`; returns the value of a Cookie header."""
    account = console.accounts[role]
    cookies = http.cookiejar.CookieJar()
    handlers: list[urllib.request.BaseHandler] = [urllib.request.HTTPCookieProcessor(cookies)]
    if console.certificate:
        handlers.append(urllib.request.HTTPSHandler(context=trust(console)))
    browser = urllib.request.build_opener(*handlers)
    address = f"{console.url}/accounts/sign-in/"
    with browser.open(address, timeout=10.0) as page:
        found = _CSRF.search(page.read().decode())
    if found is None:
        raise SignInError(f"{address} shows no form to sign in with.")
    fields = {"username": account.username, "password": account.password, "csrfmiddlewaretoken": found[1]}
    form = urllib.parse.urlencode(fields).encode()
    with browser.open(urllib.request.Request(address, form, {"Referer": address}), timeout=10.0) as page:  # noqa: S310
        if page.url == address:
            raise SignInError(f"{account.username} could not sign in.")
    return "; ".join(f"{cookie.name}={cookie.value}" for cookie in cookies)


def trust(console: Console) -> ssl.SSLContext | None:
    """Return a TLS context that trusts the console's own authority; None for plain http."""
    if console.certificate is None:
        return None
    return ssl.create_default_context(cafile=str(console.certificate.authority))


def open_socket(console: Console, path: str, cookie: str, port: int | None = None) -> connect:
    """Open a WebSocket of the console as a page does, or as a program does if `cookie` is `Bearer ...`."""
    program = cookie.startswith("Bearer ")
    return connect(
        f"{console.url.replace('http', 'ws', 1)}{path}",
        origin=None if program else console.url,  # type: ignore[arg-type]
        additional_headers={"Authorization" if program else "Cookie": cookie},
        compression=None,
        ping_interval=None,
        ssl=trust(console),
        host=console.hosts[0],
        port=port or console.port,
    )


class _Client:
    """Async context: one open WebSocket of the console, at `path`. A subclass decodes its messages and keeps them."""

    def __init__(self, console: Console, path: str, cookie: str, port: int | None = None) -> None:
        self.refused: list[wire.Refused] = []
        self.gone: wire.BridgeGone | None = None
        self._address = console, path, cookie, port
        self._answers: dict[Hashable, asyncio.Future[Any]] = {}
        self._news = asyncio.Condition()

    async def __aenter__(self) -> Self:
        self.socket: ClientConnection = await open_socket(*self._address)
        self._reader = asyncio.create_task(self._read())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.socket.close()
        self._reader.cancel()
        with suppress(asyncio.CancelledError):
            await self._reader

    async def send(self, message: msgspec.Struct) -> None:
        await self.socket.send(wire.encode(message), text=True)

    async def until(self, condition: Callable[[], Any], timeout_s: float = 10.0) -> None:
        """Wait until `condition()` is true; it is called again after every message."""
        try:
            await asyncio.wait_for(self._become(condition), timeout_s)
        except TimeoutError:
            raise TimeoutError(f"Waited {timeout_s:g} s in vain; {self.said_last()}") from None

    def said_last(self) -> str:
        """Return what the console said last, for error texts."""
        raise NotImplementedError

    async def _become(self, condition: Callable[[], Any]) -> None:
        async with self._news:
            await self._news.wait_for(condition)

    async def _read(self) -> None:
        with suppress(ConnectionClosed):
            while True:
                message = self._decoded(await self.socket.recv(decode=False))
                if isinstance(message, wire.View | wire.Sample):
                    await self.send(wire.Ack())
                async with self._news:
                    self._keep(message)
                    self._news.notify_all()

    def _decoded(self, raw: bytes) -> Any:
        raise NotImplementedError

    def _keep(self, message: Any) -> None:
        raise NotImplementedError

    async def _answer(self, key: Hashable, message: msgspec.Struct) -> Any:
        """Send a message, and return its answer."""
        answer = self._answers[key] = asyncio.get_running_loop().create_future()
        try:
            await self.send(message)
            return await asyncio.wait_for(answer, ANSWER_S)
        finally:
            del self._answers[key]

    def _answered(self, key: Hashable, message: msgspec.Struct) -> None:
        answer = self._answers.get(key)
        if answer is not None and not answer.done():
            answer.set_result(message)


class Driver(_Client):
    """A client like one open control page: it keeps the newest messages of the console, but draws nothing.

    async with Driver(stack, "tiago-1", cookie) as driver:
        await driver.take()

    `port` is the port of a proxy on this computer, if there is one. `tab` is the tab of an earlier page, to resume its
    control.
    """

    def __init__(
        self, console: Console, slug: str, cookie: str, *, port: int | None = None, tab: str | None = None
    ) -> None:
        super().__init__(console, f"/ws/robots/{slug}/", cookie, port)
        self.tab = tab or secrets.token_urlsafe(24)
        self.robot: wire.RobotFacts | None = None
        self.control: wire.Control | None = None
        self.view: wire.View | None = None
        self.offers: wire.Offers | None = None
        self.path = wire.GoPath([])
        self.notices: list[wire.Notice] = []
        self.on_frame: Callable[[bytes], Any] | None = None  # called with every message
        self.seq = 0
        self._control_heard_s = 0.0

    async def __aenter__(self) -> Self:
        await super().__aenter__()
        self._renewer = asyncio.create_task(self._renew())
        await self.send(wire.Hello(self.tab))
        await self.until(lambda: self.robot and self.control)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._renewer.cancel()
        await super().__aexit__()

    # --- messages to the console -----------------------------------------------------------------

    async def take(self) -> int:
        """Take control of a free robot, and send the stick in the middle. Returns the fence."""
        await self.send(wire.Take())
        await self.until(lambda: self.fence is not None)
        await self.drive(0.0, 0.0)
        return self.fence or 0

    async def drive(self, x: float, w: float, share: float = 0.4) -> wire.Drive:
        """Send one stick position."""
        self.seq += 1
        fence = self.fence or 1
        message = wire.Drive(fence, self.seq, time.monotonic() * 1000.0, x, w, share=share)
        await self.send(message)
        return message

    async def hold_stick(self, x: float, w: float, until: Callable[[], Any]) -> None:
        """Hold the stick until `until()` is true; like a person, let go when the robot demands a neutral stick."""
        end_s = time.monotonic() + MOST_DRIVEN_S
        while not until():
            if time.monotonic() > end_s:
                raise TimeoutError(f"{MOST_DRIVEN_S:g} s of driving were not enough; {self.said_last()}")
            if self.state and self.state.neutral_needed:
                await self.drive(0.0, 0.0)
            else:
                await self.drive(x, w)
            await asyncio.sleep(DRIVE_PERIOD_S)

    async def request_task(self, task: wire.TaskRequest) -> wire.Accepted | wire.Refused:
        """Send a task request with the next number; return the answer."""
        self.seq += 1
        answer: wire.Accepted | wire.Refused = await self._answer(
            (wire.kind_of(task), self.seq), msgspec.structs.replace(task, seq=self.seq)
        )
        return answer

    async def release(self) -> None:
        """Release control."""
        await self.send(wire.Release())
        await self.until(lambda: self.fence is None)

    async def stop(self) -> None:
        """Press the emergency stop."""
        await self.send(wire.Stop())

    async def clear(self) -> None:
        await self.send(wire.Clear(self.state.stop.number if self.state else 0))
        await self.until(lambda: self.state and self.state.stop.state == "clear")
        await self.drive(0.0, 0.0)

    # --- messages from the console ---------------------------------------------------------------

    @property
    def closed(self) -> bool:
        """Return whether the connection is closed."""
        return self._reader.done()

    @property
    def fence(self) -> int | None:
        """Return the fence if this client has control, else None."""
        return self.control.fence if self.control and self.control.state == "yours" else None

    @property
    def state(self) -> wire.State | None:
        """Return the robot's last state."""
        return self.view.state if self.view else None

    @property
    def odometry(self) -> wire.Odometry | None:
        """Return the robot's pose by its odometry."""
        return self.view.state.odometry if self.view else None

    def said_last(self) -> str:
        if self.gone:
            return f"no bridge: {self.gone.refusal.text}"
        verdict = (
            f"gate: {self.state.verdict.code} {self.state.verdict.text}"
            if self.state
            else "nothing was shown"
        )
        refused = f"last refusal: {self.refused[-1].refusal.text}" if self.refused else "nothing was refused"
        return f"{verdict}; {refused}"

    def _decoded(self, raw: bytes) -> wire.BrowserReport:
        if self.on_frame:
            self.on_frame(raw)
        return wire.browser_report(raw)

    def _keep(self, message: wire.BrowserReport) -> None:
        match message:
            case wire.View():
                self.view = message
                self.gone = None
            case wire.Control():
                self.control = message
                self._control_heard_s = time.monotonic()
            case wire.Welcome():
                self.robot = message.robot
            case wire.BridgeGone():
                self.gone = message
            case wire.Accepted():
                self._answered((message.of, message.seq or 0), message)
            case wire.Refused():
                self.refused.append(message)
                self._answered((message.of, message.seq or 0), message)
            case wire.Offers():
                self.offers = message
            case wire.GoPath():
                self.path = message
            case wire.Notice():
                self.notices.append(message)

    async def _renew(self) -> None:
        """Ask for a new term of control before the term ends, as a page does."""
        while True:
            await asyncio.sleep(1.0)
            remaining_s = self.control.remaining_s if self.fence and self.control else None
            if remaining_s is None:
                continue
            if remaining_s - (time.monotonic() - self._control_heard_s) < RENEW_BEFORE_S:
                await self.send(wire.Renew())


class Topics(_Client):
    """One open connection to a robot's topics. It keeps the newest message of each subscribed topic.

    async with Topics(stack, "tiago-1", cookie) as topics:
        graph = await topics.ask(wire.ListTopics())
        await topics.subscribe("/mobile_base_controller/odom")
        await topics.until(lambda: topics.shown)
    """

    def __init__(self, console: Console, slug: str, cookie: str) -> None:
        super().__init__(console, f"/ws/robots/{slug}/topics/", cookie)
        self.shown: dict[str, wire.Sample] = {}
        self._numbers = count(1)

    async def ask(self, question: wire.TopicQuery) -> wire.TopicAnswer:
        """Send one query; return its answer, which may be a refusal."""
        seq = next(self._numbers)
        answer: wire.TopicAnswer = await self._answer(seq, msgspec.structs.replace(question, seq=seq))
        return answer

    async def subscribe(self, topic: str, rate_hz: float = 5.0) -> None:
        await self.send(wire.Subscribe(topic, rate_hz))

    async def unsubscribe(self, topic: str) -> None:
        await self.send(wire.Unsubscribe(topic))
        self.shown.pop(topic, None)

    def said_last(self) -> str:
        return f"refused: {self.refused}; no bridge: {self.gone}"

    def _decoded(self, raw: bytes) -> wire.TopicsReport:
        return wire.topics_report(raw)

    def _keep(self, message: wire.TopicsReport) -> None:
        if isinstance(message, wire.TopicAnswer):
            self._answered(message.seq or 0, message)
        match message:
            case wire.Sample():
                self.shown[message.topic] = message
            case wire.Refused():
                self.refused.append(message)
            case wire.BridgeGone():
                self.gone = message
