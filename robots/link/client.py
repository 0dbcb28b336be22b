"""The web process's end of the bridge link: one WebSocket per (web process, robot).

A `BridgeLink` keeps itself connected and hands on what the bridge says; it never waits for a slow
bridge and never queues commands. `state_once` is for code that has no event loop.
A bridge says first whose it is. Until it said that it is this robot's, it is told nothing but who calls, and a stop:
that names its robot itself.
"""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import cache
from typing import Protocol, TypeVar, get_args
from uuid import UUID

import msgspec
from msgspec import Struct, structs
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robots import wire
from robots.bridge.config import LinkAddress
from robots.bridge.overload import LATE_S
from robots.link.connections import DOWN, open_link, open_sync, why_down
from robots.link.connections import LinkRefused as LinkRefused
from robots.link.lane import Lane
from robots.link.pending_replies import PendingReplies
from robots.stop import courier
from robots.stop.delivery import (
    SILENT,
    STOP_S,
    answer_of,
    ask_bridge,
    ask_watchdog,
    first_answer,
    reach,
    stop_message,
    wait_for,
)
from robots.stop.pending_stops import PendingStops, Waiting, name_of
from robots.wire import Accepted, Ended, Refusal, Refused, State, Stopped

log = logging.getLogger(__name__)

_Answer = TypeVar("_Answer")

_BACK_OFF_S = (0.1, 2.0)  # first and longest pause between attempts
_ANSWER_TIMEOUT_S = 1.0
_ORDER_TIMEOUT_S = 5.0  # the page gives up long before
_QUESTION_TIMEOUT_S = 12.0  # the bridge gives up after 2 s, or 10 s while its inspector starts, and says so
_ORDERS, _QUESTIONS = 64, 32  # under way at once, of all pages together
SILENT_S = 2.0  # a bridge reports its state twice a second
_BESIDE_S = 0.3  # a link that did not answer a stop by then may be dead
_ONCE_S = 3.0  # a question over a connection of its own, from the first packet to the answer
_NAMES, _NAME_LENGTH = 20, 40  # of who looks; a crowd is a number, and a message has its limit
_LOOKS_PACE_S = 0.1  # people change their minds faster than a robot should have to follow
_WATCH_S = 0.1  # how often the loop's own lateness is looked at
_WAITING_PACE_S = 0.5  # between two looks for pending stops
_DISK_S = 0.5  # a disk that does not tell them by then hangs, and keeps no link from coming up
_LINGER_S = 10.0  # a link that nobody follows for so long is closed: a page that was loaded anew finds it up

_FOREIGN = Refusal("protocol", "The bridge speaks another protocol: restart it.", "wire")
_FAULTY = Refusal("link_fault", "The console failed to follow the robot’s bridge; it tries again.", "wire")
_BUSY = Refusal("busy", "The robot’s bridge has too much to answer: wait a moment.", "wire")

_STRANGE = Refusal(
    "other_robot",
    "At this robot’s bridge address another robot’s bridge answers: staff must correct the address.",
    "robot",
)

_ORDER_KINDS = frozenset(
    kind.__struct_config__.tag for kind in (*get_args(wire.TaskRequest), wire.LinkCancel)
)


class _Hello(Struct, tag_field="t", tag="bridge_hello"):
    """The part of a hello that all protocols share. A stop needs no more."""

    robot: UUID
    slug: str


_hello = msgspec.json.Decoder(_Hello)


class Listener(Protocol):
    """Somebody who follows a robot. Called on the event loop; must not block."""

    def on_view(self, raw: str) -> None:
        """A picture, encoded."""

    def on_status(self, state: State) -> None:
        """The state, twice a second and on change."""

    def on_ended(self, ended: Ended) -> None:
        """The bridge ended control."""

    def on_refused(self, refused: Refused) -> None:
        """The bridge refused a message."""

    def on_offers(self, offers: wire.Offers) -> None:
        """The robot's capabilities: on connecting and on change."""

    def on_seen(self, topic: str, shown: str) -> None:
        """A message of a topic that is looked at, encoded."""

    def on_link(self, up: bool, refusal: Refusal | None) -> None:
        """The link came up or went down, and why."""


class BridgeLink:
    """The link to one robot's bridge. Made by `Links.get` on the running event loop."""

    def __init__(self, robot_id: UUID, address: LinkAddress, stops: PendingStops | None = None) -> None:
        self._stops = stops or PendingStops(None)
        self.robot_id = robot_id
        self.address = address
        self.up = False
        self.refusal: Refusal | None = DOWN
        self.state: State | None = None
        self.seen_at: float | None = None  # when the robot itself was last heard, in seconds since 1970
        self.offers: wire.Offers | None = None
        self.pending: wire.PendingStop | None = None  # the newest stop that waits
        self._heard_s = 0.0  # of the monotonic clock: the last state
        self.highest_fence = 0
        self._open: ClientConnection | None = None
        self._socket: ClientConnection | None = (
            None  # the same, to a bridge that said that it is this robot's
        )
        self._lane: Lane | None = None  # to a bridge on this computer
        self._listeners: set[Listener] = set()
        # of the listeners, the one for whom there are pictures and messages
        self._viewer: Listener | None = None
        self._names: frozenset[str] = frozenset()  # of those who look
        self._topics: dict[str, float] = {}  # whose messages they look at, and how often (Hz)
        self._telling: asyncio.TimerHandle | None = None  # the bridge of other topics
        self._grants: PendingReplies[None] = PendingReplies()  # by fencing number
        self._latch: PendingReplies[Stopped] = PendingReplies()  # by number
        self._orders: PendingReplies[Accepted | Refused] = (
            PendingReplies()
        )  # by kind, fencing number and number
        self._questions: PendingReplies[str] = PendingReplies()  # by number
        self._pause_s = _BACK_OFF_S[0]
        self.tried = asyncio.Event()  # a first attempt came to an end, good or bad
        self.closed = False
        self._task = asyncio.get_running_loop().create_task(self._keep_connected())
        self._courier = asyncio.get_running_loop().create_task(self._keep_delivering())
        self._lingering = self._linger()
        self._watching = self._watch_soon()

    # --- followers -----------------------------------------------------------------------------------

    def subscribe(self, listener: Listener) -> None:
        """Follow the robot. The listener is told the present state of the link at once."""
        self._listeners.add(listener)
        self._lingering.cancel()
        listener.on_link(self.up, self.refusal)
        if self.state is not None:
            listener.on_status(self.state)
        if self.offers is not None:
            listener.on_offers(self.offers)

    def unsubscribe(self, listener: Listener) -> None:
        """Stop following."""
        self._listeners.discard(listener)
        if listener is self._viewer:
            self.watch(listener, ())
            self.set_subscriptions(listener, {})
            self._viewer = None
        if not self._listeners:
            self._lingering.cancel()
            self._lingering = self._linger()

    def watch(self, viewer: Listener, names: Collection[str]) -> None:
        """Set the names of people who view through `viewer`; the bridge draws pictures only for viewers."""
        self._viewer = viewer
        if self._names != set(names):
            self._names = frozenset(names)
            self._send_watchers()

    def set_subscriptions(self, viewer: Listener, topics: Mapping[str, float]) -> None:
        """Whose messages `viewer` wants to see, and how many a second. Nobody's: the robot sends none."""
        self._viewer = viewer
        if self._topics != topics:
            self._topics = dict(topics)
            if self._telling is None:
                self._tell_looks_soon()

    @property
    def silent(self) -> bool:
        """Up, and without news for so long that the state is no longer the truth: the bridge is frozen, or cut off."""
        return self.up and time.monotonic() - self._heard_s > SILENT_S

    # --- what is sent --------------------------------------------------------------------------------

    async def forward(self, raw: str) -> bool:
        """Send a browser's drive message as it is. False if it was dropped: no link, or the last is not out yet."""
        if self._lane is not None:
            return self.forward_now(raw)
        socket = self._socket
        if socket is None or self._is_behind:
            return False
        try:
            await socket.send(raw)
        except ConnectionClosed:
            return False
        return True

    @property
    def has_lane(self) -> bool:
        """Whether `forward_now` can send."""
        return self._lane is not None

    def forward_now(self, raw: str) -> bool:
        """As `forward`, by the lane."""
        return self._lane is not None and self._lane.send(raw.encode())

    def send(self, message: Struct) -> bool:
        """Send without an answer (Revoke, Hold). False if the link is down: then the bridge has stopped the robot."""
        if self._socket is None:
            return False
        task = asyncio.ensure_future(self._send(message))
        task.add_done_callback(_swallow_closed)
        return True

    async def grant(self, grant: wire.Grant, timeout_s: float = _ANSWER_TIMEOUT_S) -> None:
        """Give or renew control. Raises LinkRefused."""
        with self._grants.waiting_for(grant.fence) as answer:
            await self._ask(grant)
            await _answered(answer, timeout_s)

    async def stop(self, stop: wire.LinkStop, timeout_s: float = STOP_S) -> Stopped | Refusal:
        """Press the emergency stop by every way there is. Raises LinkRefused if neither bridge nor watchdog answers."""
        stop = structs.replace(stop, robot=self.robot_id)
        ways = self._stop_here(stop), ask_watchdog(self.address, stop), self._stop_beside(stop)
        return await first_answer(ways, timeout_s)

    async def _stop_here(self, stop: wire.LinkStop) -> Stopped | Refusal:
        """Over this connection. Its bridge need not have said anything yet."""
        if self._open is None:
            raise LinkRefused(self.refusal or DOWN)
        number = self._latch.number()
        with self._latch.waiting_for(number) as answer:
            try:
                encoded = wire.encode(structs.replace(stop, seq=number))
                if self._lane is None or not self._lane.send(encoded):
                    await self._open.send(encoded, text=True)
                return await answer
            except LinkRefused as refused:
                if self._open is None:
                    raise
                return refused.refusal
            except ConnectionClosed as error:
                raise LinkRefused(DOWN) from error

    async def _stop_beside(self, stop: wire.LinkStop) -> Stopped | Refusal:
        """Over a connection of its own: the link may be down, waiting before its next attempt, or dead unnoticed."""
        if self._open is not None:
            await asyncio.sleep(_BESIDE_S)
        return await ask_bridge(self.address, stop)

    async def clear(
        self, clear: wire.LinkClear, asked_s: float, timeout_s: float = _ANSWER_TIMEOUT_S
    ) -> Stopped:
        """Release the latch. Raises LinkRefused when the bridge does not confirm.

        Pending stops from before `asked_s` (time of day, when the person asked) do not stop the robot again; a later
        one does.
        """
        number = self._latch.number()
        waiting = [stop for stop in await self._waiting() if stop.at < asked_s]
        with self._latch.waiting_for(number) as answer:
            presses = [stop.press for stop in waiting]
            await self._ask(structs.replace(clear, seq=number, presses=presses))
            stopped = await _answered(answer, timeout_s)
        for stop in waiting:
            await asyncio.to_thread(self._stops.settle, stop, stopped)
        return stopped

    async def order(self, order: wire.TaskRequest, timeout_s: float = _ORDER_TIMEOUT_S) -> Accepted | Refused:
        """Hand on what the holder asks for. Returns the bridge's answer; raises LinkRefused if there is none."""
        self._require_room(self._orders, _ORDERS)
        with self._orders.waiting_for((wire.kind_of(order), order.fence, order.seq)) as answer:
            await self._ask(order)
            return await _answered(answer, timeout_s)

    async def cancel(
        self, cancel: wire.LinkCancel, timeout_s: float = _ORDER_TIMEOUT_S
    ) -> Accepted | Refused:
        """Cancel for one who need not have control. As `order`."""
        number = self._orders.number()
        with self._orders.waiting_for((wire.kind_of(cancel), None, number)) as answer:
            await self._ask(structs.replace(cancel, seq=number))
            return await _answered(answer, timeout_s)

    async def ask(self, question: wire.TopicQuery, timeout_s: float = _QUESTION_TIMEOUT_S) -> str:
        """Ask about the robot's topics. Returns the encoded `wire.TopicAnswer`. Raises LinkRefused if none came."""
        self._require_room(self._questions, _QUESTIONS)
        number = self._questions.number()
        with self._questions.waiting_for(number) as answer:
            await self._ask(wire.LinkQuery(number, question))
            return await _answered(answer, timeout_s)

    async def close(self) -> None:
        """End the link for good."""
        self._lingering.cancel()
        self._end()
        for task in (self._task, self._courier):
            with suppress(asyncio.CancelledError):
                await task

    def _linger(self) -> asyncio.TimerHandle:
        """The end, unless somebody follows soon."""
        return asyncio.get_running_loop().call_later(_LINGER_S, self._end)

    def _watch_soon(self) -> asyncio.TimerHandle:
        due_s = time.monotonic() + _WATCH_S
        return asyncio.get_running_loop().call_later(_WATCH_S, self._watch_loop, due_s)

    def _watch_loop(self, due_s: float) -> None:
        """Where this process itself was late, the bridge must not blame the operator."""
        late_s = time.monotonic() - due_s
        if late_s >= LATE_S and self.up:
            late = wire.LinkLate(late_s)
            if self._lane is None or not self._lane.send(wire.encode(late)):
                self.send(late)
        self._watching = self._watch_soon()

    def _end(self) -> None:
        self.closed = True
        self._watching.cancel()
        if self._telling is not None:
            self._telling.cancel()
        self._task.cancel()
        self._courier.cancel()

    @property
    def _is_behind(self) -> bool:
        """Whether the last message is still unsent: bridge or network does not take it."""
        return self._socket is not None and self._socket.transport.get_write_buffer_size() > 0

    def _require_room(self, replies: PendingReplies[_Answer], most: int) -> None:
        """Queue nothing for a slow bridge: a stop would have to wait behind it."""
        if self._is_behind or len(replies) >= most:
            raise LinkRefused(_BUSY)

    async def _ask(self, message: Struct) -> None:
        if self._socket is None:
            raise LinkRefused(self.refusal or DOWN)
        encoded = wire.encode(message)
        if len(encoded) > wire.LARGEST_MESSAGE_BYTES:  # the bridge would not even read whose it is
            raise LinkRefused(_too_large(len(encoded)))
        try:
            await self._socket.send(encoded, text=True)
        except ConnectionClosed as error:
            raise LinkRefused(DOWN) from error

    async def _send(self, message: Struct) -> None:
        if self._socket is not None:
            await self._socket.send(wire.encode(message), text=True)

    def _send_watchers(self) -> None:
        names = sorted(self._names)
        named = [name[:_NAME_LENGTH] for name in names[:_NAMES]]
        self.send(wire.Viewers(named, len(names) - len(named)))

    def _tell_looks_soon(self) -> None:
        self._telling = asyncio.get_running_loop().call_later(_LOOKS_PACE_S, self._tell_looks)

    def _tell_looks(self) -> None:
        """A link that is behind is told later, and one that is down when it comes up."""
        self._telling = None
        if self._is_behind:
            self._tell_looks_soon()
        else:
            self.send(wire.LinkSubscribe(self._topics))

    # --- stops that wait -----------------------------------------------------------------------------

    async def _waiting(self) -> list[Waiting]:
        """Waiting stops of this robot, whichever process left them; the newest last."""
        return await asyncio.to_thread(self._stops.of, name_of(self.robot_id))

    async def _keep_delivering(self) -> None:
        """Deliver them over this link too: its bridge hears them in the moment in which it wakes."""
        while True:
            await asyncio.sleep(_WAITING_PACE_S)
            try:
                waiting = (await self._waiting())[-1:]
                self._tell_pending(waiting[0].told() if waiting else None)
                for stop in waiting:
                    await self._deliver(stop)
            except Exception:
                log.exception("a pending stop of %s could not be sent", self.robot_id)

    def _tell_pending(self, stop: wire.PendingStop | None) -> None:
        """While the link is up, the robot's state tells of stops."""
        if stop != self.pending:
            self.pending = stop
            if not self.up:
                for listener in list(self._listeners):
                    listener.on_link(False, self.refusal)

    async def _deliver(self, stop: Waiting) -> None:
        if self._open is None or self._open.transport.get_write_buffer_size() > 0:
            return
        with suppress(LinkRefused):
            answer = await first_answer([self._stop_here(stop.message())], STOP_S)
            await asyncio.to_thread(self._stops.settle, stop, answer)

    # --- the connection ------------------------------------------------------------------------------

    async def _keep_connected(self) -> None:
        while True:
            try:
                async with open_link(self.address) as socket:
                    await self._talk(socket)
            except (OSError, InvalidHandshake, asyncio.TimeoutError, ConnectionClosed) as error:
                self._went_down(why_down(error))
            except LinkRefused as error:
                if error.refusal != self.refusal:
                    log.error("the bridge of %s: %s", self.robot_id, error)
                self._went_down(error.refusal)
            except Exception:
                log.exception("the link to %s failed", self.robot_id)
                self._went_down(_FAULTY)
            await asyncio.sleep(self._pause_s)
            self._pause_s = min(2 * self._pause_s, _BACK_OFF_S[1])

    async def _talk(self, socket: ClientConnection) -> None:
        try:
            hello = wire.LinkHello(wire.PROTOCOL, f"web {os.getpid()}")
            reading = asyncio.ensure_future(self._waiting())
            # Not `wait_for`: before Python 3.12 it may swallow a cancellation, and `close` would wait for ever.
            read, _ = await asyncio.wait({reading}, timeout=_DISK_S)
            for stop in reading.result()[-1:] if read else []:  # else it is delivered later
                await socket.send(wire.encode(stop.message()), text=True)
            await socket.send(wire.encode(hello), text=True)
            self._open = socket
            while True:
                raw = await socket.recv()
                if isinstance(raw, bytes):
                    self._show(raw.decode())
                elif self._socket is not None or answer_of(raw) is not None:
                    self._heard(wire.link_report(raw))
                else:
                    await self._greeted(socket, raw)
        except msgspec.DecodeError as error:
            raise LinkRefused(_FOREIGN) from error
        finally:
            self._open = self._socket = None
            if self._lane is not None:
                self._lane.close()
                self._lane = None

    async def _greeted(self, socket: ClientConnection, hello: str) -> None:
        """The bridge said whose it is."""
        _require_robot(hello, self.robot_id, self.address)
        self._socket = socket
        self._heard(wire.link_report(hello))
        if self._names:
            self._send_watchers()
        if self._topics:
            await self._send(wire.LinkSubscribe(self._topics))

    def _open_lane(self, token: str) -> None:
        """Without a lane everything goes by the WebSocket, later by some tenths of a millisecond."""
        if self.address.unix_path is None or self._socket is None or self._lane is not None:
            return
        try:
            self._lane = Lane.connect(self.address.unix_path, token, self._socket.transport.abort)
        except OSError as error:
            log.warning("the bridge of %s has no lane: %s", self.robot_id, error)

    def _show(self, view: str) -> None:
        if self._viewer and self._names:
            self._viewer.on_view(view)

    def _heard(self, report: wire.LinkReport) -> None:
        match report:
            case wire.BridgeHello():
                if report.protocol != wire.PROTOCOL:
                    raise LinkRefused(_FOREIGN)
                self.highest_fence = report.fence
            case wire.LaneToken():
                self._open_lane(report.token)
            case wire.Status():
                self._came_up()
                self._tell_state(report.state)
            case wire.Granted():
                self.highest_fence = max(self.highest_fence, report.fence)
                self._grants.answer(report.fence, None)
            case wire.Stopped():
                self._latch.answer(report.seq, report)
            case wire.Accepted():
                self._orders.answer((report.of, report.fence, report.seq), report)
            case wire.Refused():
                self._refused(report)
            case wire.Ended():
                for listener in list(self._listeners):
                    listener.on_ended(report)
            case wire.Offers():
                self.offers = report
                for listener in list(self._listeners):
                    listener.on_offers(report)
            case wire.LinkAnswer():
                self._questions.answer(report.seq, bytes(report.answer).decode())
            case wire.LinkSample():
                self._tell_seen(report)

    def _refused(self, refused: Refused) -> None:
        refusal = LinkRefused(refused.refusal)
        match refused:
            case wire.Refused(of="grant"):
                self._grants.answer(refused.fence, refusal)
            case wire.Refused(of="link_clear" | "link_stop"):
                self._latch.answer(refused.seq, refusal)
            case wire.Refused(of="inspect"):
                self._questions.answer(refused.seq, refusal)
            case wire.Refused(of=kind) if kind in _ORDER_KINDS:
                self._orders.answer((kind, refused.fence, refused.seq), refused)
            case _:
                for listener in list(self._listeners):
                    listener.on_refused(refused)

    def _tell_seen(self, seen: wire.LinkSample) -> None:
        if self._viewer and seen.topic in self._topics:
            self._viewer.on_seen(seen.topic, bytes(seen.shown).decode())

    def _tell_state(self, state: State) -> None:
        self.state, self._heard_s = state, time.monotonic()
        if state.unseen_s is not None:
            self.seen_at = time.time() - state.unseen_s
        for listener in list(self._listeners):
            listener.on_status(state)

    def _came_up(self) -> None:
        """With the first state."""
        if self.up:
            return
        self.tried.set()
        self.up, self.refusal, self._pause_s = True, None, _BACK_OFF_S[0]
        for listener in list(self._listeners):
            listener.on_link(True, None)

    def _went_down(self, refusal: Refusal) -> None:
        """Everybody who waits is told; the last state is no longer the truth."""
        self.tried.set()
        was_up, before = self.up, self.refusal
        self.up, self.refusal = False, refusal
        self.state = self.offers = None
        for replies in (self._grants, self._latch, self._orders, self._questions):
            replies.answer_all(LinkRefused(refusal))
        if was_up:
            log.warning("link to %s lost: %s", self.robot_id, refusal.text)
        if refusal != before:
            for listener in list(self._listeners):
                listener.on_link(False, refusal)


class Links:
    """The links of this process. A robot that moved gets a new one; who follows the old one leaves it."""

    def __init__(self) -> None:
        self._links: dict[UUID, BridgeLink] = {}

    def get(self, robot_id: UUID, address: LinkAddress) -> BridgeLink:
        """The link to this robot, begun on the running loop if there is none."""
        link = self._links.get(robot_id)
        if link is None or link.closed or link.address != address:
            seen_at = link.seen_at if link else None
            link = self._links[robot_id] = BridgeLink(robot_id, address, courier.pending_stops())
            link.seen_at = seen_at
        return link

    async def close(self) -> None:
        """End all links."""
        links, self._links = list(self._links.values()), {}
        for link in links:
            await link.close()


links = Links()


def stop_once(robot_id: UUID | None, address: LinkAddress, by: str, reason: str = "") -> Stopped:
    """Press the emergency stop of this robot (None: of whichever listens there) from where there is no event loop.

    Raises LinkRefused, after `STOP_S` at the latest.
    """
    answer = wait_for(reach(address, stop_message(robot_id, by, reason)))
    if isinstance(answer, Refusal):
        raise LinkRefused(answer)
    return answer


def state_once(robot_id: UUID, address: LinkAddress) -> State:
    """How the robot is now, by its bridge, over a connection of its own. Raises LinkRefused."""
    end_s = time.monotonic() + _ONCE_S
    try:
        with open_sync(address) as socket:
            socket.send(wire.encode(wire.LinkHello(wire.PROTOCOL, f"web {os.getpid()}")), text=True)
            _require_robot(socket.recv(timeout=_ONCE_S), robot_id, address)
            while True:
                raw = socket.recv(timeout=max(end_s - time.monotonic(), 0.0))
                report = wire.link_report(raw)
                if isinstance(report, wire.Status):
                    return report.state
                if isinstance(report, Refused):
                    raise LinkRefused(report.refusal)
    except msgspec.DecodeError as error:
        raise LinkRefused(_FOREIGN) from error
    except TimeoutError as error:
        raise LinkRefused(SILENT) from error
    except (OSError, InvalidHandshake, ConnectionClosed) as error:
        raise LinkRefused(why_down(error)) from error


def _require_robot(hello: str | bytes, robot_id: UUID, address: LinkAddress) -> None:
    """Raise unless this, a bridge's first word, is of the bridge of `robot_id`."""
    said = _hello.decode(hello)
    if said.robot != robot_id:
        place = address.unix_path or f"{address.host}:{address.port}"
        _note_stranger(place, robot_id, said.slug)
        raise LinkRefused(_STRANGE)


@cache
def _note_stranger(place: str, robot_id: UUID, slug: str) -> None:
    """For the log, once: it is found again at each attempt."""
    log.error("at %s, the bridge address of robot %s, answers the bridge of %s", place, robot_id, slug)


async def _answered(answer: asyncio.Future[_Answer], timeout_s: float) -> _Answer:
    try:
        return await asyncio.wait_for(answer, timeout_s)
    except asyncio.TimeoutError as error:
        raise LinkRefused(SILENT) from error


def _too_large(size: int) -> Refusal:
    limit = wire.LARGEST_MESSAGE_BYTES
    text = f"For the robot this message has {size} bytes; at most {limit} are taken."
    return Refusal("too_large", text, "wire", {"bytes": size, "limit_bytes": limit})


def _swallow_closed(task: asyncio.Task[None]) -> None:
    error = None if task.cancelled() else task.exception()
    if error is not None and not isinstance(error, ConnectionClosed):
        log.error("sending to the bridge failed", exc_info=error)
