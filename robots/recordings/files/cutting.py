"""A part of a recording as a file of its own: a time, and chosen topics."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import BinaryIO

from mcap.writer import CompressionType, Writer

from robots.recordings.files.contents import PICTURES, Contents, Recorded

LIBRARY = "fleet console"


def cut(
    contents: Contents,
    target: BinaryIO,
    *,
    topics: Collection[str] | None = None,
    from_ns: int | None = None,
    until_ns: int | None = None,
) -> int:
    """Write the part as MCAP; return the number of its messages. Raises `Unreadable`.

    Transforms that hold for ever (`/tf_static`) and other latched messages before the part are in it, at its beginning.
    """
    writer = Writer(target, compression=CompressionType.ZSTD)
    writer.start(profile="ros1", library=LIBRARY)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count = 0
    for recorded in _from_its_state(contents, topics, from_ns, until_ns):
        schema, channel, message = recorded
        if channel.id not in channels:
            if schema is not None and schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[channel.id] = writer.register_channel(
                channel.topic,
                channel.message_encoding,
                schemas[schema.id] if schema is not None else 0,
                dict(channel.metadata),
            )
        at_ns = max(message.log_time, from_ns or 0)
        writer.add_message(channels[channel.id], at_ns, message.data, at_ns, message.sequence)
        count += 1
    for metadata in contents.metadata():
        writer.add_metadata(metadata.name, dict(metadata.metadata))
    writer.finish()  # type: ignore[no-untyped-call]
    return count


def topics_without_pictures(contents: Contents) -> list[str]:
    """Return the topics that have no pictures."""
    return [
        channel.topic
        for channel in contents.channels
        if (schema := contents.schema_of(channel)) is None or schema.name not in PICTURES
    ]


def _from_its_state(
    contents: Contents, topics: Collection[str] | None, from_ns: int | None, until_ns: int | None
) -> Iterator[Recorded]:
    """Yield the messages of the part, after the last message before it of each latched topic."""
    if from_ns is not None and from_ns > contents.begins_ns:
        for channel in contents.channels:
            if channel.metadata.get("latching") == "1" and (topics is None or channel.topic in topics):
                before = contents.newest(channel.topic, from_ns - 1)
                if before is not None:
                    yield before
    yield from contents.messages(topics, from_ns, until_ns)
