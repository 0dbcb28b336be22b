"""The contents of one recording: channels, times, messages of a window. Reads only the chunks that it needs."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from typing import BinaryIO, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message, Metadata, Schema
from mcap.summary import Summary

PICTURES = frozenset({"sensor_msgs/Image", "sensor_msgs/CompressedImage"})


class Unreadable(Exception):
    """Raised for a file that is no whole recording."""


class Recorded(NamedTuple):
    """One message with its channel. `schema` None: the channel has none."""

    schema: Schema | None
    channel: Channel
    message: Message


class Contents:
    """One file, open for reading. `stream` can seek. Raises `Unreadable`."""

    def __init__(self, stream: BinaryIO) -> None:
        stream.seek(0)
        try:
            self._reader = make_reader(stream)
            summary = self._reader.get_summary()
        except (McapError, ValueError, struct.error) as error:
            raise Unreadable(str(error)) from error
        if summary is None or summary.statistics is None:
            raise Unreadable("it has no summary: it was cut, and nobody has finished it")
        self.summary: Summary = summary
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

    def newest(self, topic: str, at_ns: int) -> Recorded | None:
        """Return the last message of a topic until this time; None: there was none yet."""
        return next(self._messages([topic], None, at_ns + 1, reverse=True), None)

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
