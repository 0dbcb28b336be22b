"""Serves whole messages of topics to web processes."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Mapping

from msgspec import structs
from websockets.asyncio.server import ServerConnection

from robots.bridge.served.server import ProcessServer, WebProcess
from robots.bridge.tap.arrivals import Arrival, Inbox, Undecoded
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.link.newest_wins import NewestWins
from robots.shared.wire import Form, Refusal, TapHeader, TapState, TapWant

Wanted = Mapping[str, int]  # topic -> longest queue
MOST_LATCHED = 64  # publishers of a topic whose newest message is kept
MOST_LATCHED_BYTES = 256 * 1024 * 1024
MOST_WAITING_BYTES = 32 * 1024 * 1024  # of a topic in one form, for one web process
BYTES_PER_S = 60e6  # to one web process, which also passes on commands; in a burst twice as many
FULL_S = 0.02  # between two looks whether the next message may be sent

_Key = tuple[str, Form]
_Stream = NewestWins[Arrival]


class _Readers(WebProcess):
    """The readers in one web process."""

    def __init__(self, socket: ServerConnection, server: TapServer) -> None:
        super().__init__(socket)
        self.streams: dict[_Key, _Stream] = {}
        self._server = server
        self._states: dict[tuple[str, Form | None], TapState] = {}
        self._alarm: asyncio.TimerHandle | None = None
        self._budget = TokenBucket(BYTES_PER_S, 2.0 * BYTES_PER_S)

    def take(self, raw: str | bytes) -> None:
        wants = wire.tap_request(raw).topics
        wanted = {(topic, form): want for topic, forms in wants.items() for form, want in forms.items()}
        for key in self.streams.keys() - wanted.keys():
            del self.streams[key]
        for key, want in wanted.items():
            if (stream := self.streams.get(key)) is not None:
                stream.every_s, stream.queue = want.every_s, want.queue
            else:
                self.streams[key] = self._server.begin(key, want, self)
        self._server.add_up()

    def offer(self, arrival: Arrival, now_s: float) -> None:
        """Let a message wait for its readers."""
        for form in wire.FORMS:
            if (stream := self.streams.get((arrival.topic, form))) is not None:
                stream.offer(arrival, len(arrival.data), now_s)
                self.news.set()

    def report(self, state: TapState) -> None:
        """Send the newest state of a topic."""
        self._states[state.topic, state.form] = state
        self.news.set()

    async def send_waiting(self) -> None:
        """Send states, then messages that are due, one of each topic and form in turn."""
        while True:
            while self._states:
                await self.socket.send(wire.encode(self._states.pop(next(iter(self._states)))), text=True)
            now_s = time.monotonic()
            due = {key: self._due_s(stream, now_s) for key, stream in self.streams.items()}
            ready = [key for key, due_s in due.items() if due_s <= now_s]
            if not ready:
                self._wake_at(min(due.values(), default=math.inf))
                return
            for key in ready:
                await self._send(key)
            await asyncio.sleep(0)

    def _due_s(self, stream: _Stream, now_s: float) -> float:
        """Return when to look at a stream again. A large message waits until the budget allows it; others go on."""
        due_s = stream.due_s()
        if due_s is None:
            return math.inf
        has_room = self._budget.left(now_s) >= stream.next_size()
        return due_s if has_room else max(due_s, now_s + FULL_S)

    async def _send(self, key: _Key) -> None:
        stream = self.streams.get(key)
        if stream is None or stream.due_s() is None:  # the readers left during the sending
            return
        began_s = time.monotonic()
        arrival = stream.pop(began_s)
        frame = self._server.frame(key[1], arrival)
        now_s = time.monotonic()
        stream.rest(now_s, now_s - began_s)
        if frame is not None:
            self._budget.spend(now_s, min(len(frame), self._budget.left(now_s)))
            await self.socket.send(frame)

    def _wake_at(self, due_s: float) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
        if due_s < math.inf:
            wait_s = max(due_s - time.monotonic(), 0.0)
            self._alarm = asyncio.get_running_loop().call_later(wait_s, self.news.set)


class TapServer(ProcessServer[_Readers]):
    """Accepts web processes. `set_wanted` gets the topics that all of them read."""

    ping_s = wire.TAP_PING_S

    def __init__(
        self, address: LinkAddress, set_wanted: Callable[[Wanted], None], wake: Callable[[], None]
    ) -> None:
        super().__init__("tap", address)
        self.inbox = Inbox(wake)
        self._set_wanted = set_wanted
        self._wanted: Wanted = {}
        self._states: dict[str, TapState] = {}
        self._refusals: dict[_Key, Refusal] = {}
        self._latched: dict[str, dict[int, Arrival]] = {}

    def connected(self, socket: ServerConnection) -> _Readers:
        return _Readers(socket, self)

    def left(self) -> None:
        self.add_up()

    def add_up(self) -> None:
        """Read what all web processes want, and nothing else."""
        wanted: dict[str, int] = {}
        for process in self.processes:
            for (topic, _), stream in process.streams.items():
                wanted[topic] = max(stream.queue, wanted.get(topic, 1))
        if wanted != self._wanted:
            self._wanted = wanted
            self._set_wanted(wanted)

    def begin(self, key: _Key, want: TapWant, process: _Readers) -> _Stream:
        """Return a new stream, with what is known of its topic."""
        topic, form = key
        stream = _Stream(want.every_s, want.queue, MOST_WAITING_BYTES)
        for arrival in self._latched.get(topic, {}).values():
            stream.put_first(arrival, len(arrival.data))
        if (state := self._states.get(topic)) is not None:
            process.report(state)
            if (refusal := self._refusals.get(key)) is not None:
                process.report(structs.replace(state, refusal=refusal, form=form))
        process.news.set()
        return stream

    def take_arrivals(self) -> None:
        """Pass on the messages that have arrived."""
        now_s = time.monotonic()
        for arrival in self.inbox.take():
            state = self._states.get(arrival.topic)
            if state is None or not state.type:  # no reader gets a message before its type
                self.report(arrival.publisher.state(arrival.topic))
            if arrival.publisher.latched and arrival.topic in self._wanted:
                self._keep(arrival)
            for process in self.processes:
                process.offer(arrival, now_s)

    def forget(self, topic: str) -> None:
        """Note that a topic is not read any more."""
        self._states.pop(topic, None)
        self._latched.pop(topic, None)
        for form in wire.FORMS:
            self._refusals.pop((topic, form), None)

    def report(self, state: TapState) -> None:
        """Send a topic's state to its readers. A topic keeps its type, for which readers wait before a message."""
        if not state.type and (known := self._states.get(state.topic)) is not None:
            state = structs.replace(known, refusal=state.refusal)
        if state.topic in self._wanted:
            self._states[state.topic] = state
            for process in self.processes:
                if any(topic == state.topic for topic, _ in process.streams):
                    process.report(state)

    def frame(self, form: Form, arrival: Arrival) -> bytes | None:
        """Return the frame of a message; None, and its readers learn why, if it cannot be sent."""
        key, refusal = (arrival.topic, form), None
        frame = None
        try:
            header = TapHeader(
                arrival.topic,
                form,
                arrival.number,
                arrival.stamp_ns,
                arrival.publisher.number,
                arrival.publisher.latched,
            )
            frame = wire.tapped(header, arrival.body(form))
        except Undecoded as error:
            refusal = error.refusal
        if refusal != self._refusals.get(key):
            self._refuse(key, refusal)
        return frame

    def _refuse(self, key: _Key, refusal: Refusal | None) -> None:
        topic, form = key
        if refusal is None:
            del self._refusals[key]
        else:
            self._refusals[key] = refusal
        state = structs.replace(self._states.get(topic, TapState(topic)), refusal=refusal, form=form)
        for process in self.processes:
            if key in process.streams:
                process.report(state)

    def _keep(self, arrival: Arrival) -> None:
        """Keep the newest message of each latched publisher, as far as memory allows."""
        kept = self._latched.setdefault(arrival.topic, {})
        kept.pop(arrival.publisher.number, None)
        kept[arrival.publisher.number] = arrival
        while len(kept) > MOST_LATCHED:
            del kept[next(iter(kept))]
        while self._latched and self._latched_bytes() > MOST_LATCHED_BYTES:
            del self._latched[next(iter(self._latched))]

    def _latched_bytes(self) -> int:
        return sum(len(each.data) for kept in self._latched.values() for each in kept.values())
