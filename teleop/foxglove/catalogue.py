"""The topics of a robot, read once for all Foxglove connections of this process while there is one.

A topic becomes a channel when a node publishes it and the definition of its type is known. Channels have the same
numbers for all connections, so that each change is encoded once.
"""

from __future__ import annotations

import asyncio
import logging
import time
from contextlib import suppress
from itertools import count
from typing import Any, NamedTuple, Protocol
from uuid import UUID

import msgspec

from robots.link.client import BridgeLink, LinkRefused
from robots.shared import wire
from robots.shared.wire import Refusal
from teleop.foxglove import connection_graph
from teleop.foxglove.connection_graph import ConnectionGraph
from teleop.foxglove.protocol import Channel, channel, encoded

log = logging.getLogger(__name__)

READ_S = 2.0  # between two readings of the master
PARAMETERS_S = 5.0  # until parameters are read again
UNKNOWN_S = 30.0  # until a publisher is asked again for a definition that it did not send
FIRST_S = 4.0  # the longest time that a new connection waits for the first reading

_answer = msgspec.json.Decoder(wire.DoorAnswer)


class Change(NamedTuple):
    """A change of the catalogue, encoded. `ended`: the numbers of channels that are gone."""

    channels: list[str]
    graph: str | None
    ended: frozenset[int]


class Reader(Protocol):
    """A connection that follows the catalogue. Called on the event loop; must not block."""

    def catalogue_changed(self, change: Change) -> None:
        """Receive a change."""

    def catalogue_refused(self, refusal: Refusal) -> None:
        """Note that the robot's master cannot be read, and why."""


class Catalogue:
    """Channels, connection graph and parameters of one robot. Made by `catalogue_of`; ends with its last reader."""

    def __init__(self, link: BridgeLink) -> None:
        self.link = link
        self.channels: dict[str, Channel] = {}  # by topic
        self.by_id: dict[int, Channel] = {}
        self.graph = ConnectionGraph({}, {}, {})
        self.refusal: Refusal | None = None
        self._readers: set[Reader] = set()
        self._read = asyncio.Event()  # the first reading is over
        self._raw = ""
        self._rows: list[wire.TopicRow] = []
        self._listed: dict[str, str] = {}  # types of published topics, as the master lists them
        self._texts: dict[str, str] = {}  # definitions by type
        self._asked_s: dict[
            str, float
        ] = {}  # types that no one has described yet, and when they were asked for
        self._numbers = count(1)
        self._values: tuple[float, dict[str, Any]] | None = None
        self._values_read = asyncio.Lock()
        self._task = asyncio.create_task(self._keep_reading())

    def add(self, reader: Reader) -> None:
        """Tell one more connection all changes from now on."""
        self._readers.add(reader)

    def remove(self, reader: Reader) -> None:
        """Remove a reader. Must not wait."""
        self._readers.discard(reader)
        if not self._readers:
            if _catalogues.get(self.link.robot_id) is self:
                del _catalogues[self.link.robot_id]
            self._task.cancel()

    async def first_read(self) -> None:
        """Wait until the master was read once, at most `FIRST_S`."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._read.wait(), FIRST_S)

    def whole(self) -> str:
        """Return all channels, encoded."""
        return encoded("advertise", channels=list(self.channels.values()))

    def correct(self, topic: str, type_name: str, text: str) -> None:
        """Note type and definition of the topic's publisher: the master may list others."""
        channel = self.channels.get(topic)
        if channel is not None and (channel.schemaName, channel.schema) != (type_name, _schema(text)):
            self._apply({**self.channels, topic: self._channel(topic, type_name, text)}, self.graph)

    # --- parameters --------------------------------------------------------------------------------

    async def parameters(self) -> dict[str, Any]:
        """Return all parameters by name, at most `PARAMETERS_S` old. Raises LinkRefused."""
        async with self._values_read:
            if self._values is None or time.monotonic() - self._values[0] > PARAMETERS_S:
                tree = await self._ask(wire.GetAllParameters())
                self._values = time.monotonic(), dict(_leaves("", tree.value))
            return self._values[1]

    # --- reading -----------------------------------------------------------------------------------

    async def _keep_reading(self) -> None:
        while True:
            try:
                await self._read_once()
                self.refusal = None
            except LinkRefused as refused:
                if refused.refusal != self.refusal:
                    self.refusal = refused.refusal
                    for reader in list(self._readers):
                        reader.catalogue_refused(refused.refusal)
            except Exception:
                log.exception("The catalogue of robot %s was not read.", self.link.robot_id)
            self._read.set()
            await asyncio.sleep(READ_S)

    async def _read_once(self) -> None:
        raw = await self.link.query_topics(wire.ListTopics(), person=None)
        if raw != self._raw:
            graph = _decoded(raw)
            self._raw, self._rows = raw, graph.topics
            graph_now = connection_graph.of(graph)
        else:
            graph_now = self.graph
        published = {row.name: row.type for row in self._rows if row.publishers and "/" in row.type}
        unknown = await self._learn(published)
        self._show(published, graph_now)
        for type_name, topic in unknown.items():
            with suppress(LinkRefused):  # a publisher that does not answer, or describes its type badly
                self._texts[type_name] = (await self._ask(wire.Describe(type_name, topic))).text
                self._show(published, graph_now)

    async def _learn(self, published: dict[str, str]) -> dict[str, str]:
        """Learn the definitions that the console knows. Return the other types, each with a topic to ask about."""
        types, now_s = {type_name: topic for topic, type_name in published.items()}, time.monotonic()
        self._texts = {name: text for name, text in self._texts.items() if name in types}
        self._asked_s = {name: asked_s for name, asked_s in self._asked_s.items() if name in types}
        due = {
            name: topic
            for name, topic in types.items()
            if name not in self._texts and now_s - self._asked_s.get(name, -UNKNOWN_S) >= UNKNOWN_S
        }
        if due:
            known = (await self._ask(wire.ListDefinitions())).texts
            self._asked_s |= dict.fromkeys(due, now_s)
            self._texts |= {name: text for name in due if (text := known.get(name))}
        return {name: topic for name, topic in due.items() if name not in self._texts}

    def _show(self, published: dict[str, str], graph: ConnectionGraph) -> None:
        """Show the topics whose types are known."""
        channels = {
            topic: self._kept(topic, type_name)
            for topic, type_name in published.items()
            if type_name in self._texts
        }
        self._listed = published
        self._apply(channels, graph)

    async def _ask(self, query: wire.TopicQuery | wire.DoorQuery) -> Any:
        return _decoded(await self.link.query_topics(query, person=None))

    def _kept(self, topic: str, type_name: str) -> Channel:
        """Return the topic's channel: the same one, also after `correct`, while the master lists the same type."""
        channel = self.channels.get(topic)
        if channel is not None and self._listed.get(topic) == type_name:
            return channel
        return self._channel(topic, type_name, self._texts[type_name])

    def _channel(self, topic: str, type_name: str, text: str) -> Channel:
        return channel(next(self._numbers), topic, type_name, _schema(text))

    def _apply(self, channels: dict[str, Channel], graph: ConnectionGraph) -> None:
        """Replace channels and graph, and tell the readers what changed."""
        ended = [one.id for topic, one in self.channels.items() if channels.get(topic) is not one]
        new = [one for topic, one in channels.items() if self.channels.get(topic) is not one]
        messages = [encoded("unadvertise", channelIds=ended)] if ended else []
        messages += [encoded("advertise", channels=new)] if new else []
        news = connection_graph.update(self.graph, graph)
        self.channels, self.graph = channels, graph
        self.by_id = {one.id: one for one in channels.values()}
        if messages or news:
            change = Change(messages, news, frozenset(ended))
            for reader in list(self._readers):
                reader.catalogue_changed(change)


def _schema(text: str) -> str:
    """Return a definition as clients want it: none that is empty."""
    return (text.strip("\n") and text) or "# no fields\n"


def _decoded(raw: str) -> Any:
    """Return a robot's answer. Raises LinkRefused if it is a refusal."""
    answer = _answer.decode(raw)
    if isinstance(answer, wire.Refused):
        raise LinkRefused(answer.refusal)
    return answer


def _leaves(name: str, value: Any) -> list[tuple[str, Any]]:
    """Return the parameters of a tree with their whole names, as the master lists them."""
    if isinstance(value, dict):
        return [leaf for key, inner in sorted(value.items()) for leaf in _leaves(f"{name}/{key}", inner)]
    return [(name, value)]


_catalogues: dict[UUID, Catalogue] = {}


def catalogue_of(link: BridgeLink) -> Catalogue:
    """Return the robot's catalogue in this web process; a robot with a new link gets a new one."""
    catalogue = _catalogues.get(link.robot_id)
    if catalogue is None or catalogue.link is not link:
        catalogue = _catalogues[link.robot_id] = Catalogue(link)
    return catalogue
