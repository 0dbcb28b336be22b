"""The messages of one robot's topics in this web process, and their readers.

The tap reads and encodes each message once. A reader whose client is behind gets the newest later, so that one slow
client harms nobody.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Hashable
from functools import partial
from typing import NamedTuple
from uuid import UUID

from msgspec import ValidationError, convert

from robots.link.client import BridgeLink
from robots.link.tap_link import STARTING, TapLink
from robots.shared.link.flood_limits import TokenBucket
from robots.shared.link.newest_wins import NewestWins
from robots.shared.sentences import say
from robots.shared.wire import (
    FORMS,
    MOST_QUEUED,
    MOST_TAPPED,
    Form,
    Refusal,
    TapHeader,
    TapState,
    TapWant,
    TapWants,
    TopicName,
)

log = logging.getLogger(__name__)

MOST_READINGS = 200  # of one connection: topics, each in a form
MOST_OF_PERSON = 200  # topics of a robot: so nobody alone takes all `MOST_TAPPED`
# Bytes and messages a second; the burst is two seconds. What exceeds them waits, and newer messages replace it.
PERSON_BYTES_PER_S, PERSON_MESSAGES_PER_S = 40e6, 2000.0
ROBOT_BYTES_PER_S, ROBOT_MESSAGES_PER_S = 80e6, 5000.0
MOST_LATCHED_BYTES = 64 * 1024 * 1024  # of a robot
LOOK_AGAIN_S = 0.02  # at a client that is behind
YIELD_S = 0.0005  # drive input waits at most for this time plus the sending of one message

MOST_WAITING_BYTES = 16 * 1024 * 1024  # of a topic in one form, for one connection
TOO_MANY_READINGS = Refusal(
    "too_many_topics",
    say("One connection reads at most {most} topics at once.", most=MOST_READINGS),
    "limits",
    {"limit": MOST_READINGS},
)


class TapMessage(NamedTuple):
    """One message. All readers of a topic in one form get the same object."""

    topic: str
    number: int  # counts those of the topic, also those that are not sent
    stamp_ns: int  # of the arrival, by the clock of the bridge's computer
    body: bytes


Deliver = Callable[[str, Form, TapMessage], Awaitable[None]]
Reading = NewestWins[TapMessage]


class _Budget:
    """Limits bytes and messages a second."""

    def __init__(self, bytes_per_s: float, messages_per_s: float) -> None:
        self._bytes = TokenBucket(bytes_per_s, 2.0 * bytes_per_s)
        self._messages = TokenBucket(messages_per_s, 2.0 * messages_per_s)
        self.readers = 0

    def allows(self, size: int, now_s: float) -> bool:
        return self._bytes.left(now_s) >= size and self._messages.left(now_s) >= 1.0

    def spend(self, size: int, now_s: float) -> None:
        self._bytes.spend(now_s, size)
        self._messages.spend(now_s)


def _is_name(topic: str) -> bool:
    """Return whether the tap takes this name: one that it does not would end its connection, and all readings."""
    try:
        convert(topic, TopicName)
    except ValidationError:
        return False
    return True


class TapReader:
    """One connection's readings.

    `deliver` sends a message to the client. `state` gets what is known of a topic, on each change. `is_behind`: whether
    the client has not read what was sent. Readers of one `person` share limits.
    """

    def __init__(
        self,
        feed: TapFeed,
        deliver: Deliver,
        state: Callable[[TapState], None],
        is_behind: Callable[[], bool],
        person: Hashable = None,
    ) -> None:
        self.feed = feed
        self.state = state
        self.is_behind = is_behind
        self.person = self if person is None else person
        self.readings: dict[tuple[str, Form], Reading] = {}
        self._deliver = deliver
        self._alarm: asyncio.TimerHandle | None = None
        feed.add(self)

    def read(self, topic: str, form: Form, every_s: float = 0.0, queue: int = 1) -> Refusal | None:
        """Read a topic, or change how it is read. `every_s`: the shortest time between two messages."""
        queue = max(1, min(queue, MOST_QUEUED))
        every_s = max(0.0, min(every_s, 3600.0))
        if (reading := self.readings.get((topic, form))) is not None:
            reading.every_s, reading.queue = every_s, queue
            self.feed.changed()
            return None
        if not _is_name(topic):
            text = say("“{topic}” is no name of a topic.", topic=topic[:100])
            return Refusal("invalid", text, "wire", {"topic": topic[:100]})
        if len(self.readings) >= MOST_READINGS:
            return TOO_MANY_READINGS
        if (most := self.feed.exceeded(topic, self.person)) is not None:
            text = say("At most {most} topics of one robot are read at once.", most=most)
            return Refusal("too_many_topics", text, "limits", {"limit": most})
        self.readings[topic, form] = reading = Reading(every_s, queue, MOST_WAITING_BYTES)
        self.feed.begin(self, topic, form, reading)
        return None

    def end(self, topic: str, form: Form) -> None:
        """Stop reading a topic in this form."""
        if self.readings.pop((topic, form), None) is not None:
            self.feed.changed()

    def leave(self) -> None:
        """Stop reading: the connection ends."""
        self.readings.clear()
        self.call_again(None, lambda: None)
        self.feed.remove(self)

    def reads(self, topic: str, form: Form | None = None) -> bool:
        """Return whether this topic is read, in this form or in any."""
        return any((topic, each) in self.readings for each in (FORMS if form is None else (form,)))

    def due_s(self) -> float | None:
        """Return when the next message may be sent; None: none waits."""
        return min(
            (due_s for each in self.readings.values() if (due_s := each.due_s()) is not None), default=None
        )

    def call_again(self, wait_s: float | None, look: Callable[[], None]) -> None:
        """Call `look` after this time, and not at an earlier order; None: never."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
        if wait_s is not None:
            self._alarm = asyncio.get_running_loop().call_later(wait_s, look)

    async def send_due(self, now_s: float) -> bool:
        """Send what is due. Return False if the client is behind, or a topic waits for the limits: others go on."""
        all_sent = True
        for (topic, form), reading in list(self.readings.items()):
            while (due_s := reading.due_s()) is not None and due_s <= now_s:
                if self.is_behind():
                    return False
                if not self.feed.may_send(self, reading.next_size(), now_s):
                    all_sent = False
                    break
                await self._deliver(topic, form, reading.pop(now_s))
        return all_sent


class TapFeed:
    """All topics that are read of one robot. `feed_of` creates it. It ends with its last reader."""

    def __init__(self, link: BridgeLink) -> None:
        self.link = link
        self._tap = TapLink(link, self)
        self._readers: set[TapReader] = set()
        self._ready: dict[TapReader, None] = {}  # in order
        self._states: dict[tuple[str, Form | None], TapState] = {}
        self._latched: OrderedDict[tuple[str, Form, int], TapMessage] = OrderedDict()
        self._latched_bytes = 0
        self._budget = _Budget(ROBOT_BYTES_PER_S, ROBOT_MESSAGES_PER_S)
        self._budgets: dict[Hashable, _Budget] = {}
        self._gone: Refusal | None = STARTING
        self._wants_due: asyncio.Handle | None = None
        self._news = asyncio.Event()
        self._task = asyncio.create_task(self._keep_sending())

    # --- readers -----------------------------------------------------------------------------------

    def add(self, reader: TapReader) -> None:
        """Serve one more connection."""
        self._readers.add(reader)
        budget = self._budgets.setdefault(reader.person, _Budget(PERSON_BYTES_PER_S, PERSON_MESSAGES_PER_S))
        budget.readers += 1

    def remove(self, reader: TapReader) -> None:
        """Serve a connection no longer. Does not wait."""
        if reader not in self._readers:
            return
        self._readers.discard(reader)
        self._ready.pop(reader, None)
        self._budgets[reader.person].readers -= 1
        if not self._budgets[reader.person].readers:
            del self._budgets[reader.person]
        self.changed()
        if self._readers:
            return
        if _feeds.get(self.link.robot_id) is self:
            del _feeds[self.link.robot_id]
        if self._wants_due is not None:
            self._wants_due.cancel()
        self._task.cancel()
        self._tap.close()

    def exceeded(self, topic: str, person: Hashable) -> int | None:
        """Return the limit that forbids this person to read one more topic; None: none, or this one is read."""
        own = {name for each in self._readers if each.person == person for name, _ in each.readings}
        if topic in own:
            return None
        if len(own) >= MOST_OF_PERSON:
            return MOST_OF_PERSON
        topics = {name for reader in self._readers for name, _ in reader.readings}
        return MOST_TAPPED if topic not in topics and len(topics) >= MOST_TAPPED else None

    def begin(self, reader: TapReader, topic: str, form: Form, reading: Reading) -> None:
        """Begin a reading with what is known of its topic."""
        self.changed()
        for key, message in self._latched.items():
            if key[:2] == (topic, form):
                reading.put_first(message, len(message.body))
                self._wake(reader)
        if self._gone is not None:
            reader.state(TapState(topic, refusal=self._gone))
            return
        for each in (None, form):
            if (state := self._states.get((topic, each))) is not None:
                reader.state(state)

    def changed(self) -> None:
        """Tell the tap soon what is read."""
        if self._wants_due is None:
            self._wants_due = asyncio.get_running_loop().call_soon(self._send_wants)

    def may_send(self, reader: TapReader, size: int, now_s: float) -> bool:
        """Return whether limits allow a message of this size, and count it."""
        budgets = self._budget, self._budgets[reader.person]
        if not all(budget.allows(size, now_s) for budget in budgets):
            return False
        for budget in budgets:
            budget.spend(size, now_s)
        return True

    def _send_wants(self) -> None:
        self._wants_due = None
        wants: dict[str, dict[Form, TapWant]] = {}
        for reader in self._readers:
            for (topic, form), reading in reader.readings.items():
                forms = wants.setdefault(topic, {})
                before = forms.get(form, TapWant(reading.every_s))
                forms[form] = TapWant(min(reading.every_s, before.every_s), max(reading.queue, before.queue))
        self._states = {key: state for key, state in self._states.items() if key[0] in wants}
        for key in [key for key in self._latched if key[1] not in wants.get(key[0], {})]:
            self._latched_bytes -= len(self._latched.pop(key).body)
        self._tap.set_wants(TapWants(wants))

    # --- messages (robots.link.tap_link.TapListener) --------------------------------------------------

    def on_tapped(self, header: TapHeader, body: memoryview) -> None:
        """Offer a message to its readers."""
        self._gone = None
        topic, form = header.topic, header.form
        message = TapMessage(topic, header.number, header.stamp_ns, bytes(body))
        if header.latched:
            self._keep((topic, form, header.publisher), message)
        now_s = time.monotonic()
        for reader in self._readers:
            if (reading := reader.readings.get((topic, form))) is not None:
                reading.offer(message, len(message.body), now_s)
                self._wake(reader)

    def on_tap_state(self, state: TapState) -> None:
        """Pass on what is known of a topic."""
        self._gone = None
        self._states[state.topic, state.form] = state
        for reader in list(self._readers):
            if reader.reads(state.topic, state.form):
                reader.state(state)

    def on_tap_gone(self, refusal: Refusal) -> None:
        """Tell all readers the reason. Latched messages come again with the next tap."""
        self._states.clear()
        self._latched.clear()
        self._latched_bytes = 0
        if refusal == self._gone:
            return
        self._gone = refusal
        for reader in list(self._readers):
            for topic in {topic for topic, _ in reader.readings}:
                reader.state(TapState(topic, refusal=refusal))

    def _keep(self, key: tuple[str, Form, int], message: TapMessage) -> None:
        """Keep the newest message of a latched publisher, as far as memory allows."""
        if (before := self._latched.pop(key, None)) is not None:
            self._latched_bytes -= len(before.body)
        self._latched[key] = message
        self._latched_bytes += len(message.body)
        while self._latched_bytes > MOST_LATCHED_BYTES:
            _, oldest = self._latched.popitem(last=False)
            self._latched_bytes -= len(oldest.body)

    # --- sending ---------------------------------------------------------------------------------------

    def _wake(self, reader: TapReader) -> None:
        self._ready[reader] = None
        self._news.set()

    async def _keep_sending(self) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            began_s = time.monotonic()
            for reader in list(self._ready):
                self._ready.pop(reader, None)
                await self._send(reader)
                if time.monotonic() - began_s > YIELD_S:
                    await asyncio.sleep(0)  # handle drive input that has arrived since
                    began_s = time.monotonic()

    async def _send(self, reader: TapReader) -> None:
        wait_s = LOOK_AGAIN_S
        try:
            if await reader.send_due(time.monotonic()):
                wait_s = 0.0
        except OSError:
            return  # the connection is gone; its consumer detects this itself
        except Exception:
            log.exception("A message of a topic was not sent.")
        due_s = reader.due_s()
        if reader in self._readers:
            again_s = None if due_s is None else max(due_s - time.monotonic(), wait_s)
            reader.call_again(again_s, partial(self._wake, reader))


_feeds: dict[UUID, TapFeed] = {}


def feed_of(link: BridgeLink) -> TapFeed:
    """Return the robot's feed in this web process; a robot with a new link gets a new feed."""
    feed = _feeds.get(link.robot_id)
    if feed is None or feed.link is not link:
        feed = _feeds[link.robot_id] = TapFeed(link)
    return feed
