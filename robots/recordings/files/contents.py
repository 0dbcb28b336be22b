"""The contents of one recording: channels, times, messages of a window. Reads only the chunks that it needs.

The index of a long recording takes a second to read, and each request needs it: those of the last files stay in memory.
"""

from __future__ import annotations

import os
import struct
import threading
from collections import OrderedDict
from collections.abc import Collection, Hashable, Iterator
from typing import BinaryIO, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Message, Metadata, Schema
from mcap.summary import Summary

from robots.shared.messages.type_names import bare

_PICTURES = frozenset({"sensor_msgs/Image", "sensor_msgs/CompressedImage"})

MOST_KNOWN = 1_000_000  # entries of all indexes in memory, of about 64 bytes


def is_picture(type_name: str) -> bool:
    """Return whether messages of this type are pictures."""
    return bare(type_name) in _PICTURES


class Unreadable(Exception):
    """Raised for a file that is no whole recording."""


class Recorded(NamedTuple):
    """One message with its channel. `schema` None: the channel has none."""

    schema: Schema | None
    channel: Channel
    message: Message


class Summaries:
    """The indexes of the files that were read last. Thread-safe."""

    def __init__(self, most: int = MOST_KNOWN) -> None:
        self._most = most
        self._lock = threading.Lock()
        self._known: OrderedDict[Hashable, tuple[Summary, int]] = OrderedDict()

    def get(self, key: Hashable) -> Summary | None:
        with self._lock:
            if key not in self._known:
                return None
            self._known.move_to_end(key)
            return self._known[key][0]

    def put(self, key: Hashable, summary: Summary) -> None:
        entries = sum(10 + len(index.message_index_offsets) for index in summary.chunk_indexes)
        with self._lock:
            self._known[key] = summary, entries
            while sum(count for _, count in self._known.values()) > self._most and len(self._known) > 1:
                self._known.popitem(last=False)


_summaries = Summaries()


class _Reader(SeekingReader):
    """A reader that may know the index already."""

    def know(self, summary: Summary | None) -> None:
        self._summary = summary


class Contents:
    """One file, open for reading. `stream` can seek. Raises `Unreadable`.

    `name` of the recording: its index stays in memory.
    """

    def __init__(self, stream: BinaryIO, name: Hashable = None) -> None:
        key = name, stream.seek(0, os.SEEK_END)  # a file from which people were cut has another size
        stream.seek(0)
        try:
            self._reader = _Reader(stream)
            self._reader.know(_summaries.get(key))
            header = self._reader.get_header()
            summary = self._reader.get_summary()
        except (McapError, ValueError, struct.error) as error:
            raise Unreadable(str(error)) from error
        if summary is None or summary.statistics is None:
            raise Unreadable("it has no summary: it was cut, and nobody has finished it")
        if name is not None:
            _summaries.put(key, summary)
        self.summary: Summary = summary
        self.profile: str = header.profile
        self.messages_count = summary.statistics.message_count
        self.begins_ns = summary.statistics.message_start_time
        self.ends_ns = summary.statistics.message_end_time

    @property
    def channels(self) -> list[Channel]:
        """The channels, sorted by topic."""
        return sorted(self.summary.channels.values(), key=lambda channel: (channel.topic, channel.id))

    def schema_of(self, channel: Channel) -> Schema | None:
        """Return the schema of a channel."""
        return self.summary.schemas.get(channel.schema_id)

    def count(self, channel: Channel) -> int:
        """Return the number of messages of a channel."""
        assert self.summary.statistics is not None  # noqa: S101  (see `__init__`)
        return self.summary.statistics.channel_message_counts.get(channel.id, 0)

    def metadata(self) -> list[Metadata]:
        """Return what the recorder wrote about the recording."""
        return list(self._reader.iter_metadata())

    def messages(
        self, topics: Collection[str] | None = None, from_ns: int | None = None, until_ns: int | None = None
    ) -> Iterator[Recorded]:
        """Yield messages in the order of their time. `until_ns` is exclusive. Raises `Unreadable`."""
        return self._messages(topics, from_ns, until_ns, reverse=False)

    def newest(self, topic: str, at_ns: int, channel: int | None = None) -> Recorded | None:
        """Return the last message of a topic, or of one of its channels, until this time; None: there was none yet."""
        found = self._messages([topic], None, at_ns + 1, reverse=True)
        return next((one for one in found if channel in (None, one.channel.id)), None)

    def _messages(
        self, topics: Collection[str] | None, from_ns: int | None, until_ns: int | None, reverse: bool
    ) -> Iterator[Recorded]:
        wanted = None if topics is None else list(topics)
        if from_ns is not None and until_ns is not None and from_ns >= until_ns:
            return
        try:
            for found in self._reader.iter_messages(
                wanted, starting_at=from_ns, ending_before=until_ns, reverse=reverse
            ):
                yield Recorded(*found)
        except (McapError, ValueError, KeyError, struct.error) as error:
            raise Unreadable(str(error)) from error
