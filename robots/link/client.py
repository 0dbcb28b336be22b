"""The web process's end of the bridge link: one WebSocket per (web process, robot).

A `BridgeLink` reconnects by itself and passes the bridge's messages on. It never waits for a slow bridge and never
queues drive input. Code without an event loop uses `robots.link.state_reader`.
A bridge first sends the id of its robot. Until this id is checked, the link sends only its hello and stops, because a
stop contains the id of its robot.
"""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Mapping
from contextlib import suppress
from functools import cache
from typing import TypeVar, get_args
from uuid import UUID
from weakref import WeakKeyDictionary

import msgspec
from msgspec import Struct, structs
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robots.link import stop_courier as courier
from robots.link.connections import LinkRefused as LinkRefused
from robots.link.connections import down, open_link, why_down
from robots.link.pending_replies import PendingReplies
from robots.link.stop_delivery import (
    SILENT,
    STOP_S,
    answer_of,
    ask_bridge,
    ask_watchdog,
    first_answer,
)
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.link.lane import Lane
from robots.shared.link.pending_stops import PendingStops, WaitingStop, name_of
from robots.shared.processes.in_step import next_step
from robots.shared.processes.overload import LATE_S
from robots.shared.sentences import say
from robots.shared.wire import Accepted, Ended, Refusal, Refused, State, Stopped

log = logging.getLogger(__name__)

_Answer = TypeVar("_Answer")

_BACK_OFF_S = (0.1, 2.0)  # first and longest pause between attempts
_ANSWER_TIMEOUT_S = 1.0
_TASK_TIMEOUT_S = 5.0  # the page stops waiting much earlier
_RECORD_TIMEOUT_S = 12.0  # the bridge answers within 10 s, when its recorder has started
_QUERY_TIMEOUT_S = 12.0  # the bridge reports a failure after 2 s, or after 10 s while its inspector starts
_MOST_TASK_REQUESTS, _MOST_QUERIES = 64, 32  # at once, for all pages together
_MOST_QUERIES_OF_PERSON = 8  # so that calls that never return shut out nobody else
SILENT_S = 2.0  # a bridge reports its state twice a second
_LINK_STOP_S = 0.3  # if a stop has no answer after this time, the link may be dead
# Names of viewers; further viewers are only counted, because the size of a message is limited
_NAMES, _NAME_LENGTH = 20, 40
_SUBSCRIPTIONS_PACE_S = 0.1  # changes of subscriptions within this time are sent as one
_LATENESS_CHECK_S = 0.1  # how often the loop's lateness is measured
WAITING_PACE_S = 0.5  # between two searches for pending stops
_DISK_S = 0.5  # time limit for reading pending stops, so that a slow disk does not delay the link
LINGER_S = 10.0  # a link without listeners stays open for this time, for a page that is reloaded

OTHER_PROTOCOL = Refusal(
    "protocol",
    "The robot’s bridge has another version than the console. Tell staff to restart it.",
    "wire",
)
_FAULTY = Refusal("link_fault", "The server failed to follow the robot’s bridge; it tries again.", "wire")
_BUSY = Refusal("busy", "The robot’s bridge has too much to answer: wait a moment.", "wire")
_TOO_MANY_QUERIES = Refusal(
    "busy",
    say("More than {most} queries at once: wait for the answers.", most=_MOST_QUERIES_OF_PERSON),
    "limits",
    {"limit": _MOST_QUERIES_OF_PERSON},
)

_OTHER_ROBOT = Refusal(
    "other_robot",
    "Another robot’s bridge answers at this robot’s address. Staff must correct the address.",
    "robot",
)

_ANSWERED = (*get_args(wire.TaskRequest), wire.LinkCancel, wire.LinkRecord, wire.LinkRecordEnd, wire.LinkKeep)
_TASK_KINDS = frozenset(kind.__struct_config__.tag for kind in _ANSWERED)


class _Hello(Struct, tag_field="t", tag="bridge_hello"):
    """The part of a hello that all versions of the protocol have; it is enough to check the robot."""

    robot: UUID
    slug: str


_hello = msgspec.json.Decoder(_Hello)


class Listener:
    """Receives a robot's reports, and ignores them. Called on the event loop; must not block."""

    def on_view(self, raw: str) -> None:
        """Receive a view, encoded."""

    def on_status(self, state: State) -> None:
        """Receive the state, twice a second and on change."""

    def on_ended(self, ended: Ended) -> None:
        """Note that the bridge ended control."""

    def on_refused(self, refused: Refused) -> None:
        """Note that the bridge refused a message."""

    def on_offers(self, offers: wire.Offers) -> None:
        """Receive the robot's capabilities, on connecting and on change."""

    def on_path(self, path: wire.GoPath) -> None:
        """Receive the path of the robot's navigation, on connecting and on change."""

    def on_sample(self, topic: str, sample: str) -> None:
        """Receive a message of a subscribed topic, encoded."""

    def on_link(self, up: bool, refusal: Refusal | None) -> None:
        """Note that the link came up, or why it is down."""


class BridgeLink:
    """The link to one robot's bridge. Made by `Links.get` on the running event loop."""

    def __init__(self, robot_id: UUID, address: LinkAddress, stops: PendingStops | None = None) -> None:
        self._stops = stops or PendingStops(None)
        self.robot_id = robot_id
        self._name = name_of(robot_id)
        self.address = address
        self.up = False
        self.refusal: Refusal | None = down(self.address)
        self.state: State | None = None
        self.seen_at: float | None = None  # time of the last message from the robot, seconds since 1970
        self.offers: wire.Offers | None = None
        self.path = wire.GoPath([])
        self.pending: wire.PendingStop | None = None  # the newest stop that waits
        self._heard_s = 0.0  # monotonic clock: when the last state arrived
        self.highest_fence = 0
        self._open: ClientConnection | None = None
        self._socket: ClientConnection | None = None  # the same, after a check of the bridge's robot
        self._lane: Lane | None = None  # to a bridge on this computer
        self._listeners: set[Listener] = set()
        # the one listener that gets views and samples
        self._viewer: Listener | None = None
        self._names: frozenset[str] = frozenset()  # of the viewers
        self._draw_joints = False  # whether a viewer draws the robot's joints
        self._topics: dict[str, float] = {}  # subscribed topics and their rates (Hz)
        self._process_listeners: dict[wire.ProcessName, Callable[[wire.ProcessAt], None]] = {}
        self._subscriptions_timer: asyncio.TimerHandle | None = None  # sends changes of `_topics`
        self._grants: PendingReplies[None] = PendingReplies()  # by fence
        self._latch: PendingReplies[Stopped] = PendingReplies()  # by number
        # By kind, fence and number
        self._task_requests: PendingReplies[Accepted | Refused] = PendingReplies()
        self._queries: PendingReplies[str] = PendingReplies()  # by number
        self._asking: Counter[Hashable] = Counter()  # pending queries by person
        self._pause_s = _BACK_OFF_S[0]
        self.tried = asyncio.Event()  # set after the first attempt to connect, with or without success
        self.closed = False
        self._task = asyncio.get_running_loop().create_task(self._keep_connected())
        self._courier = asyncio.get_running_loop().create_task(self._keep_delivering())
        self._linger_timer = self._start_linger()
        self._lateness_timer = self._schedule_lateness_check()

    # --- listeners -----------------------------------------------------------------------------------

    def subscribe(self, listener: Listener) -> None:
        """Add a listener; it gets the current state of the link at once."""
        self._listeners.add(listener)
        self._linger_timer.cancel()
        listener.on_link(self.up, self.refusal)
        if self.state is not None:
            listener.on_status(self.state)
        if self.offers is not None:
            listener.on_offers(self.offers)
        if self.path.path_cm:
            listener.on_path(self.path)

    def unsubscribe(self, listener: Listener) -> None:
        """Remove a listener; the link closes later if it was the last."""
        self._listeners.discard(listener)
        if listener is self._viewer:
            self.set_viewers(listener, ())
            self.set_subscriptions(listener, {})
            self._viewer = None
        if not self._listeners:
            self._linger_timer.cancel()
            self._linger_timer = self._start_linger()

    def set_viewers(self, viewer: Listener, names: Collection[str], joints: bool = False) -> None:
        """Set the names of the people who look through `viewer`. Without viewers the bridge sends no views.

        `joints`: whether one of them draws the robot's joints.
        """
        self._viewer = viewer
        if self._names != set(names) or self._draw_joints != joints:
            self._names, self._draw_joints = frozenset(names), joints
            self._send_viewers()

    def set_subscriptions(self, viewer: Listener, topics: Mapping[str, float]) -> None:
        """Set the topics that `viewer` shows, with rates (Hz). Without topics the bridge sends no samples."""
        self._viewer = viewer
        if self._topics != topics:
            self._topics = dict(topics)
            if self._subscriptions_timer is None:
                self._schedule_subscriptions()

    def need_process(self, name: wire.ProcessName, listener: Callable[[wire.ProcessAt], None]) -> None:
        """Let a process beside the bridge run and report its address to `listener`."""
        self._process_listeners[name] = listener
        self.send(wire.LinkProcess(name, True))

    def leave_process(self, name: wire.ProcessName, listener: Callable[[wire.ProcessAt], None]) -> None:
        """Need the process no longer for `listener`, unless another listener has replaced it."""
        if self._process_listeners.get(name) == listener:
            del self._process_listeners[name]
            self.send(wire.LinkProcess(name, False))

    @property
    def silent(self) -> bool:
        """Return whether the link is up, but the last state is too old: the bridge is frozen or cut off."""
        return self.up and time.monotonic() - self._heard_s > SILENT_S

    # --- sending --------------------------------------------------------------------------------------

    @property
    def has_lane(self) -> bool:
        """Whether the bridge is on this computer, and its drive lane is open."""
        return self._lane is not None

    def forward_by_lane(self, raw: str) -> bool:
        """Send a page's drive input unchanged by the drive lane. Returns False if it is dropped."""
        return self._lane is not None and self._lane.send(raw.encode())

    async def forward(self, raw: str) -> bool:
        """Send a page's drive input unchanged. Returns False if it is dropped: no link, or older bytes wait."""
        if self.has_lane:
            return self.forward_by_lane(raw)
        socket = self._socket
        if socket is None or self._is_behind:
            return False
        try:
            await socket.send(raw)
        except ConnectionClosed:
            return False
        return True

    def send(self, message: Struct) -> bool:
        """Send a message that has no answer, such as Revoke.

        Returns False if the link is down: then the bridge has stopped the robot.
        """
        if self._socket is None:
            return False
        task = asyncio.ensure_future(self._send(message))
        task.add_done_callback(_swallow_closed)
        return True

    async def grant(self, grant: wire.Grant, timeout_s: float = _ANSWER_TIMEOUT_S) -> None:
        """Send a grant, which gives or renews control. Raises LinkRefused if the bridge refuses or does not answer."""
        with self._grants.waiting_for(grant.fence) as answer:
            await self._ask(grant)
            await _await_answer(answer, timeout_s)

    async def stop(self, stop: wire.LinkStop, timeout_s: float = STOP_S) -> Stopped | Refusal:
        """Send the emergency stop by three ways at the same time. Raises LinkRefused if there is no answer."""
        stop = structs.replace(stop, robot=self.robot_id)
        ways = self._stop_by_link(stop), ask_watchdog(self.address, stop), self._stop_by_new_connection(stop)
        return await first_answer(ways, timeout_s)

    async def _stop_by_link(self, stop: wire.LinkStop) -> Stopped | Refusal:
        """Send a stop over this connection, even before the bridge's hello."""
        if self._open is None:
            raise LinkRefused(self.refusal or down(self.address))
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
                raise LinkRefused(down(self.address)) from error

    async def _stop_by_new_connection(self, stop: wire.LinkStop) -> Stopped | Refusal:
        """Send a stop over a new connection: this link may be down, waiting to reconnect, or dead without notice."""
        if self._open is not None:
            await asyncio.sleep(_LINK_STOP_S)
        return await ask_bridge(self.address, stop)

    async def clear(self, clear: wire.LinkClear, asked_s: float) -> Stopped:
        """Clear the stop. Raises LinkRefused if the bridge does not confirm.

        `asked_s` is the time of day when the person asked. Pending stops from before it do not stop the robot again;
        later ones do.
        """
        number = self._latch.number()
        waiting = [stop for stop in await self._waiting_stops() if stop.at < asked_s]
        with self._latch.waiting_for(number) as answer:
            presses = [stop.press for stop in waiting]
            await self._ask(structs.replace(clear, seq=number, presses=presses))
            stopped = await _await_answer(answer, _ANSWER_TIMEOUT_S)
        for stop in waiting:
            await asyncio.to_thread(self._stops.settle, stop, stopped)
        return stopped

    async def request_task(self, request_task: wire.TaskRequest) -> Accepted | Refused:
        """Send a task request of the person in control. Returns the bridge's answer, or raises LinkRefused."""
        self._require_capacity(self._task_requests, _MOST_TASK_REQUESTS)
        with self._task_requests.waiting_for(
            (wire.kind_of(request_task), request_task.fence, request_task.seq)
        ) as answer:
            await self._ask(request_task)
            return await _await_answer(answer, _TASK_TIMEOUT_S)

    async def cancel(self, cancel: wire.LinkCancel) -> Accepted | Refused:
        """Cancel a task for a person, who need not have control. Returns and raises as `request_task`."""
        number = self._task_requests.number()
        with self._task_requests.waiting_for((wire.kind_of(cancel), None, number)) as answer:
            await self._ask(structs.replace(cancel, seq=number))
            return await _await_answer(answer, _TASK_TIMEOUT_S)

    async def ask_recorder(
        self, order: wire.LinkRecord | wire.LinkRecordEnd | wire.LinkKeep
    ) -> Accepted | Refused:
        """Begin or end a recording, or keep what was before now. Returns and raises as `request_task`."""
        self._require_capacity(self._task_requests, _MOST_TASK_REQUESTS)
        number = self._task_requests.number()
        with self._task_requests.waiting_for((wire.kind_of(order), None, number)) as answer:
            await self._ask(structs.replace(order, seq=number))
            return await _await_answer(answer, _RECORD_TIMEOUT_S)

    async def query_topics(self, question: wire.TopicQuery | wire.DoorQuery, *, person: Hashable) -> str:
        """Send a query about topics for a person (None: for the console itself).

        Returns the encoded `wire.DoorAnswer`, or raises LinkRefused.
        """
        self._require_capacity(self._queries, _MOST_QUERIES)
        if person is not None and self._asking[person] >= _MOST_QUERIES_OF_PERSON:
            raise LinkRefused(_TOO_MANY_QUERIES)
        self._asking[person] += 1
        try:
            number = self._queries.number()
            with self._queries.waiting_for(number) as answer:
                await self._ask(wire.LinkQuery(number, question))
                return await _await_answer(answer, _QUERY_TIMEOUT_S)
        finally:
            self._asking -= Counter([person])  # drops those that reach zero

    async def close(self) -> None:
        """End the link. It cannot be opened again."""
        self._linger_timer.cancel()
        self._end()
        for task in (self._task, self._courier):
            with suppress(asyncio.CancelledError):
                await task

    def _start_linger(self) -> asyncio.TimerHandle:
        """Close the link after `LINGER_S`, unless a listener comes first."""
        return asyncio.get_running_loop().call_later(LINGER_S, self._end)

    def _schedule_lateness_check(self) -> asyncio.TimerHandle:
        now_s = time.monotonic()
        due_s = next_step(now_s, _LATENESS_CHECK_S)
        return asyncio.get_running_loop().call_later(due_s - now_s, self._check_lateness, due_s)

    def _check_lateness(self, due_s: float) -> None:
        """Report to the bridge that this loop is late, so that the bridge does not count it as the operator's delay."""
        late_s = time.monotonic() - due_s
        if late_s >= LATE_S and self.up:
            late = wire.LinkLate(late_s)
            if self._lane is None or not self._lane.send(wire.encode(late)):
                self.send(late)
        self._lateness_timer = self._schedule_lateness_check()

    def _end(self) -> None:
        self.closed = True
        self._lateness_timer.cancel()
        if self._subscriptions_timer is not None:
            self._subscriptions_timer.cancel()
        self._task.cancel()
        self._courier.cancel()

    @property
    def _is_behind(self) -> bool:
        """Return whether older bytes wait: the bridge or the network does not take them."""
        return self._socket is not None and self._socket.transport.get_write_buffer_size() > 0

    def _require_capacity(self, replies: PendingReplies[_Answer], most: int) -> None:
        """Raise LinkRefused if the bridge is slow or has too many requests: a stop would have to wait behind them."""
        if self._is_behind or len(replies) >= most:
            raise LinkRefused(_BUSY)

    async def _ask(self, message: Struct) -> None:
        if self._socket is None:
            raise LinkRefused(self.refusal or down(self.address))
        encoded = wire.encode(message)
        if len(encoded) > wire.LARGEST_MESSAGE_BYTES:  # the bridge could not read it, and so could not answer
            raise LinkRefused(_too_large(len(encoded)))
        try:
            await self._socket.send(encoded, text=True)
        except ConnectionClosed as error:
            raise LinkRefused(down(self.address)) from error

    async def _send(self, message: Struct) -> None:
        if self._socket is not None:
            await self._socket.send(wire.encode(message), text=True)

    def _send_viewers(self) -> None:
        names = sorted(self._names)
        named = [name[:_NAME_LENGTH] for name in names[:_NAMES]]
        self.send(wire.Viewers(named, len(names) - len(named), self._draw_joints))

    def _schedule_subscriptions(self) -> None:
        self._subscriptions_timer = asyncio.get_running_loop().call_later(
            _SUBSCRIPTIONS_PACE_S, self._send_subscriptions
        )

    def _send_subscriptions(self) -> None:
        """Send the subscriptions; later if older bytes wait, or, if the link is down, when it comes up."""
        self._subscriptions_timer = None
        if self._is_behind:
            self._schedule_subscriptions()
        else:
            self.send(wire.LinkSubscribe(self._topics))

    # --- pending stops --------------------------------------------------------------------------------

    async def _waiting_stops(self) -> list[WaitingStop]:
        """Return the pending stops of this robot from all processes, the newest last."""
        return await asyncio.to_thread(self._stops.of, self._name)

    async def _keep_delivering(self) -> None:
        """Deliver pending stops over this link too: a frozen bridge reads them as soon as it continues."""
        while True:
            now_s = time.monotonic()
            await asyncio.sleep(next_step(now_s, WAITING_PACE_S) - now_s)
            try:
                waiting = [stop for stop in await _look(self._stops) if stop.name == self._name][-1:]
                self._report_pending(waiting[0].on_wire() if waiting else None)
                for stop in waiting:
                    await self._deliver(stop)
            except Exception:
                log.exception("a pending stop of %s could not be sent", self.robot_id)

    def _report_pending(self, stop: wire.PendingStop | None) -> None:
        """Report a pending stop to listeners while the link is down. If it is up, the state contains the stop."""
        if stop != self.pending:
            self.pending = stop
            if not self.up:
                for listener in list(self._listeners):
                    listener.on_link(False, self.refusal)

    async def _deliver(self, stop: WaitingStop) -> None:
        if self._open is None or self._open.transport.get_write_buffer_size() > 0:
            return
        with suppress(LinkRefused):
            answer = await first_answer([self._stop_by_link(stop.message())], STOP_S)
            await asyncio.to_thread(self._stops.settle, stop, answer)

    # --- the connection ------------------------------------------------------------------------------

    async def _keep_connected(self) -> None:
        while True:
            try:
                async with open_link(self.address) as socket:
                    await self._run_connection(socket)
            except (TimeoutError, OSError, InvalidHandshake, ConnectionClosed) as error:
                self._handle_loss(why_down(error, self.address))
            except LinkRefused as error:
                if error.refusal != self.refusal:
                    log.error("the bridge of %s: %s", self.robot_id, error)
                self._handle_loss(error.refusal)
            except Exception:
                log.exception("the link to %s failed", self.robot_id)
                self._handle_loss(_FAULTY)
            await asyncio.sleep(self._pause_s)
            self._pause_s = min(2 * self._pause_s, _BACK_OFF_S[1])

    async def _run_connection(self, socket: ClientConnection) -> None:
        try:
            hello = wire.LinkHello(wire.PROTOCOL, f"web {os.getpid()}")
            reading = asyncio.ensure_future(self._waiting_stops())
            # Do not use `wait_for`: before Python 3.12 it may lose a cancellation, and `close` would wait for ever.
            read, _ = await asyncio.wait({reading}, timeout=_DISK_S)
            for stop in reading.result()[-1:] if read else []:  # `_keep_delivering` delivers it later
                await socket.send(wire.encode(stop.message()), text=True)
            await socket.send(wire.encode(hello), text=True)
            self._open = socket
            while True:
                raw = await socket.recv()
                if isinstance(raw, bytes):
                    self._forward_view(raw.decode())
                elif self._socket is not None or answer_of(raw) is not None:
                    self._handle_report(wire.link_report(raw))
                else:
                    await self._handle_hello(socket, raw)
        except msgspec.DecodeError as error:
            raise LinkRefused(OTHER_PROTOCOL) from error
        finally:
            self._open = self._socket = None
            if self._lane is not None:
                self._lane.close()
                self._lane = None

    async def _handle_hello(self, socket: ClientConnection, hello: str) -> None:
        """Check the id of the bridge's robot, then send viewers and subscriptions."""
        require_robot(hello, self.robot_id, self.address)
        self._socket = socket
        self._handle_report(wire.link_report(hello))
        if self._names:
            self._send_viewers()
        if self._topics:
            await self._send(wire.LinkSubscribe(self._topics))
        for name in list(self._process_listeners):
            await self._send(wire.LinkProcess(name, True))

    def _open_lane(self, token: str) -> None:
        """Open the lane to a bridge on this computer.

        Without a lane, all messages go over the WebSocket and arrive some tenths of a millisecond later.
        """
        if self.address.unix_path is None or self._socket is None or self._lane is not None:
            return
        try:
            self._lane = Lane.connect(self.address.unix_path, token, self._socket.transport.abort)
        except OSError as error:
            log.warning("the bridge of %s has no lane: %s", self.robot_id, error)

    def _forward_view(self, view: str) -> None:
        if self._viewer and self._names:
            self._viewer.on_view(view)

    def _handle_report(self, report: wire.LinkReport) -> None:
        match report:
            case wire.BridgeHello():
                if report.protocol != wire.PROTOCOL:
                    raise LinkRefused(OTHER_PROTOCOL)
                self.highest_fence = report.fence
            case wire.LaneToken():
                self._open_lane(report.token)
            case wire.Status():
                self._handle_first_state()
                self._report_state(report.state)
            case wire.Granted():
                self.highest_fence = max(self.highest_fence, report.fence)
                self._grants.answer(report.fence, None)
            case wire.Stopped():
                self._latch.answer(report.seq, report)
            case wire.Accepted():
                self._task_requests.answer((report.of, report.fence, report.seq), report)
            case wire.Refused():
                self._refused(report)
            case wire.Ended():
                for listener in list(self._listeners):
                    listener.on_ended(report)
            case wire.Offers():
                self.offers = report
                for listener in list(self._listeners):
                    listener.on_offers(report)
            case wire.GoPath():
                self.path = report
                for listener in list(self._listeners):
                    listener.on_path(report)
            case wire.LinkAnswer():
                self._queries.answer(report.seq, bytes(report.answer).decode())
            case wire.LinkSample():
                self._forward_sample(report)
            case wire.ProcessAt(process=name):
                if (move := self._process_listeners.get(name)) is not None:
                    move(report)

    def _refused(self, refused: Refused) -> None:
        refusal = LinkRefused(refused.refusal)
        match refused:
            case wire.Refused(of="grant"):
                self._grants.answer(refused.fence, refusal)
            case wire.Refused(of="link_clear" | "link_stop"):
                self._latch.answer(refused.seq, refusal)
            case wire.Refused(of="inspect"):
                self._queries.answer(refused.seq, refusal)
            case wire.Refused(of=kind) if kind in _TASK_KINDS:
                self._task_requests.answer((kind, refused.fence, refused.seq), refused)
            case _:
                for listener in list(self._listeners):
                    listener.on_refused(refused)

    def _forward_sample(self, report: wire.LinkSample) -> None:
        if self._viewer and report.topic in self._topics:
            self._viewer.on_sample(report.topic, bytes(report.sample).decode())

    def _report_state(self, state: State) -> None:
        self.state, self._heard_s = state, time.monotonic()
        if state.unseen_s is not None:
            self.seen_at = time.time() - state.unseen_s
        for listener in list(self._listeners):
            listener.on_status(state)

    def _handle_first_state(self) -> None:
        """Report that the link is up, after the first state."""
        if self.up:
            return
        self.tried.set()
        self.up, self.refusal, self._pause_s = True, None, _BACK_OFF_S[0]
        for listener in list(self._listeners):
            listener.on_link(True, None)

    def _handle_loss(self, refusal: Refusal) -> None:
        """Refuse all pending requests, and delete the state, which is out of date."""
        self.tried.set()
        was_up, before = self.up, self.refusal
        self.up, self.refusal = False, refusal
        self.state, self.offers, self.path = None, None, wire.GoPath([])
        for name, move in list(self._process_listeners.items()):
            move(wire.ProcessAt(name))
        for replies in (self._grants, self._latch, self._task_requests, self._queries):
            replies.answer_all(LinkRefused(refusal))
        if was_up:
            log.warning("link to %s lost: %s", self.robot_id, refusal.text)
        if refusal != before:
            for listener in list(self._listeners):
                listener.on_link(False, refusal)


class Links:
    """The links of this process. If a robot's address changes, `get` makes a new link; callers move their listeners."""

    def __init__(self) -> None:
        self._links: dict[UUID, BridgeLink] = {}

    def get(self, robot_id: UUID, address: LinkAddress) -> BridgeLink:
        """Return the link to this robot; if there is none, start it on the running loop."""
        link = self._links.get(robot_id)
        if link is None or link.closed or link.address != address:
            seen_at = link.seen_at if link else None
            link = self._links[robot_id] = BridgeLink(robot_id, address, courier.pending_stops())
            link.seen_at = seen_at
        return link

    def all(self) -> list[BridgeLink]:
        return [link for link in self._links.values() if not link.closed]

    async def close(self) -> None:
        """End all links."""
        links, self._links = list(self._links.values()), {}
        for link in links:
            await link.close()


links = Links()


def require_robot(hello: str | bytes, robot_id: UUID, address: LinkAddress) -> None:
    """Raise LinkRefused unless this hello comes from the bridge of `robot_id`."""
    said = _hello.decode(hello)
    if said.robot != robot_id:
        place = address.unix_path or f"{address.host}:{address.port}"
        _log_wrong_robot(place, robot_id, said.slug)
        raise LinkRefused(_OTHER_ROBOT)


@cache
def _log_wrong_robot(place: str, robot_id: UUID, slug: str) -> None:
    """Log the wrong robot only once, because each attempt to connect finds it again."""
    log.error("the bridge address %s of robot %s belongs to the bridge of %s", place, robot_id, slug)


_looks: WeakKeyDictionary[PendingStops, asyncio.Task[list[WaitingStop]]] = WeakKeyDictionary()


async def _look(stops: PendingStops) -> list[WaitingStop]:
    """Return all pending stops. Links that look at the same time share one look, and one thread."""
    look = _looks.get(stops)
    if look is None or look.done():
        look = _looks[stops] = asyncio.create_task(asyncio.to_thread(stops.all))
    return await asyncio.shield(look)


async def _await_answer(answer: asyncio.Future[_Answer], timeout_s: float) -> _Answer:
    try:
        return await asyncio.wait_for(answer, timeout_s)
    except TimeoutError as error:
        raise LinkRefused(SILENT) from error


def _too_large(size: int) -> Refusal:
    limit = wire.LARGEST_MESSAGE_BYTES
    text = say("This message has {size} bytes; the robot accepts at most {limit}.", size=size, limit=limit)
    return Refusal("too_large", text, "wire", {"bytes": size, "limit_bytes": limit})


def _swallow_closed(task: asyncio.Task[None]) -> None:
    error = None if task.cancelled() else task.exception()
    if error is not None and not isinstance(error, ConnectionClosed):
        log.error("sending to the bridge failed", exc_info=error)
