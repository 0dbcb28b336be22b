"""The post of a robot's clients: letters to clients of this web process go directly, others by the channel layer.

Each web process tells the others every `TELL_S`, and on each change, what its clients offer. What the clients of a
silent process offered is gone after `GONE_S`. It never reaches the robot.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from uuid import UUID, uuid4
from weakref import WeakKeyDictionary

import msgspec
from channels.layers import get_channel_layer
from msgspec import Struct

from robots.shared import wire
from robots.shared.wire import NotDone
from teleop.background.channel_group import keep_receiving
from teleop.background.jobs import run_in_background
from teleop.live.consumers.message_socket import BUSY
from teleop.live.robot_hub import RobotHub
from teleop.rosbridge.clients.letters import Address, Gone, Kind, Letter, Offer, Shown, returned

log = logging.getLogger(__name__)

TELL_S = 2.0
GONE_S = 6.0
MOST_WAITING = 100  # letters to other web processes; each is as long as an operation at most
CLOSE_S = 2.0  # for the last letters

Handler = Callable[[Address, Any], Awaitable[None]]  # gets the sender and its letter; raises nothing


class _Sent(Struct, frozen=True, tag=True):
    """A letter between web processes; `to`: a client, or all."""

    by: Address
    to: str | None
    letter: Letter


class _Told(Struct, frozen=True, tag=True):
    """The offers of the clients of a web process. `asks`: it does not know yet what others offer."""

    process: str
    channel: str
    offers: list[Offer]
    asks: bool = False


@dataclass
class _Peer:
    """Another web process."""

    channel: str
    offers: dict[tuple[Kind, str], Offer]
    heard_s: float


_decode = msgspec.json.Decoder(_Sent | _Told).decode


class Post:
    """The post of one robot in this web process. It works while it has clients."""

    def __init__(self, robot_id: UUID) -> None:
        self.process = uuid4().hex
        self._group = f"clients.{robot_id.hex}"
        self._clients: dict[str, dict[type[Letter], Handler]] = {}
        self._offers: dict[tuple[Kind, str], Offer] = {}
        self._peers: dict[str, _Peer] = {}
        self._channel: str | None = None  # where other processes reach this one
        # Encoded, with the channel of a process; None: for all
        self._out: asyncio.Queue[tuple[str | None, str]] = asyncio.Queue(MOST_WAITING)
        self._tasks: list[asyncio.Task[None]] = []

    # --- clients ----------------------------------------------------------------------------------------

    def join(self, client: str, handlers: Mapping[type[Letter], Handler]) -> Address:
        """Let a client get letters of these kinds. Return its address."""
        self._clients.setdefault(client, {}).update(handlers)
        if not self._tasks:
            work = (
                keep_receiving(self._group, self._receive, self._joined),
                self._keep_sending(),
                self._keep_telling(),
            )
            self._tasks = [run_in_background(each) for each in work]
        return Address(self.process, client)

    def leave(self, client: str) -> None:
        """Forget a client that is gone, with its offers."""
        if self._clients.pop(client, None) is None:
            return
        if mine := [key for key, offer in self._offers.items() if offer.client == client]:
            for key in mine:
                del self._offers[key]
            self._tell()
        if not self._clients:
            run_in_background(self._rest())

    async def _rest(self) -> None:
        """Send what waits, then end."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._out.join(), CLOSE_S)
        if not self._clients:
            for task in self._tasks:
                task.cancel()
            self._tasks, self._channel, self._peers = [], None, {}

    # --- offers -------------------------------------------------------------------------------------------

    def offer(self, offer: Offer) -> None:
        """Tell everybody what a client offers."""
        self._offers[offer.kind, offer.name] = offer
        self._tell()

    def take_back(self, kind: Kind, name: str) -> None:
        """End an offer."""
        del self._offers[kind, name]
        self._tell()

    def find(self, kind: Kind, name: str) -> tuple[Offer, Address] | None:
        """Return what a client offers by this name, and where that client is."""
        for process, offers in self._all():
            if (offer := offers.get((kind, name))) is not None:
                return offer, Address(process, offer.client)
        return None

    def listed(self, kind: Kind) -> Iterator[Offer]:
        """Return all offers of a kind."""
        return (one for _, offers in self._all() for one in offers.values() if one.kind == kind)

    def _all(self) -> Iterator[tuple[str, dict[tuple[Kind, str], Offer]]]:
        yield self.process, self._offers
        yield from ((process, peer.offers) for process, peer in self._peers.items())

    # --- letters --------------------------------------------------------------------------------------------

    async def send(self, by: Address, to: Address, letter: Letter) -> None:
        """Send a letter. Raises NotDone if too many wait. It may get lost on the way to another web process."""
        sent = _Sent(by, to.client, letter)
        if to.process == self.process:
            await self._deliver(sent)
        elif (peer := self._peers.get(to.process)) is not None:
            self._put(peer.channel, sent)

    async def show(self, by: Address, shown: Shown) -> None:
        """Send a message of a topic to all clients. Raises NotDone if too many wait."""
        sent = _Sent(by, None, shown)
        if self._peers:
            self._put(None, sent)
        await self._deliver(sent)

    def _put(self, channel: str | None, message: _Sent | _Told) -> None:
        try:
            self._out.put_nowait((channel, wire.encode(message).decode()))
        except asyncio.QueueFull as error:
            raise NotDone(BUSY) from error

    async def _deliver(self, sent: _Sent) -> None:
        kind = type(sent.letter)
        to = list(self._clients) if sent.to is None else [sent.to]
        for client in to:
            handler = self._clients.get(client, {}).get(kind)
            if handler is not None:
                await handler(sent.by, sent.letter)
            elif client not in self._clients and (answer := returned(sent.letter)) is not None:
                await self.send(Address(self.process, client), sent.by, answer)

    # --- other web processes ------------------------------------------------------------------------------------

    def _joined(self, channel: str) -> None:
        self._channel = channel
        self._tell(asks=True)

    def _tell(self, *, asks: bool = False) -> None:
        """Tell what the clients here offer; `_keep_telling` repeats it."""
        if self._channel is not None:
            with suppress(NotDone):
                self._put(None, _Told(self.process, self._channel, list(self._offers.values()), asks))

    async def _keep_telling(self) -> None:
        while True:
            await asyncio.sleep(TELL_S)
            self._tell()
            silent = [name for name, peer in self._peers.items() if time.monotonic() - peer.heard_s > GONE_S]
            for process in silent:
                del self._peers[process]
                await self._deliver(_Sent(Address(process, ""), None, Gone(process)))

    async def _keep_sending(self) -> None:
        layer = get_channel_layer()
        reachable = True
        while True:
            channel, body = await self._out.get()
            event = {"type": "clients.post", "by": self.process, "body": body}
            try:
                if layer is not None and channel is not None:
                    await layer.send(channel, event)
                elif layer is not None:
                    await layer.group_send(self._group, event)
                reachable = True
            except Exception as error:  # noqa: BLE001 - each backend has its own errors; the sender waits in vain
                if reachable:
                    log.warning("Messages to clients at other web processes are lost: %s", error)
                reachable = False
            finally:
                self._out.task_done()

    async def _receive(self, event: dict[str, Any]) -> None:
        if event["by"] == self.process:
            return
        try:
            match _decode(event["body"]):
                case _Told() as told:
                    self._peers[told.process] = _Peer(
                        told.channel,
                        {(offer.kind, offer.name): offer for offer in told.offers},
                        time.monotonic(),
                    )
                    if told.asks:
                        self._tell()
                case _Sent() as sent:
                    await self._deliver(sent)
        except NotDone:
            pass  # no room for an answer: who asked gives up
        except Exception:
            log.exception("A message of another web process could not be delivered.")


_posts: WeakKeyDictionary[RobotHub, Post] = WeakKeyDictionary()


def post_of(hub: RobotHub) -> Post:
    """Return the post of a robot's clients."""
    if hub not in _posts:
        _posts[hub] = Post(hub.robot_id)
    return _posts[hub]
