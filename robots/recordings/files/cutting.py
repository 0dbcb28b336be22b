"""A part of a recording as a file of its own: a time, and chosen topics."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import BinaryIO

import msgspec
from mcap.writer import CompressionType, Writer

from robots.recordings.files.contents import Contents, Recorded, is_picture
from robots.shared.records.record_sink import ABOUT, TakenRecording

LIBRARY = "fleet console"
ALL = ((0, 2**63 - 1),)


def cut(
    contents: Contents,
    target: BinaryIO,
    *,
    topics: Collection[str] | None = None,
    windows: Sequence[tuple[int, int]] = ALL,
    about: TakenRecording,
    shape: Callable[[Recorded], Recorded] = lambda recorded: recorded,
) -> int:
    """Write the parts (ns, ends exclusive, in order) as MCAP; return the number of messages. Raises `Unreadable`.

    `shape` returns each message as it is written.
    `about`: what the new file says of itself. The whole file names everybody; who gets a part may not read that.
    Transforms that hold for ever (`/tf_static`) and other latched messages before a part are in it, at its beginning.
    """
    writer = Writer(target, compression=CompressionType.ZSTD)
    writer.start(profile=contents.profile, library=LIBRARY)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count = 0
    for at_ns, recorded in parts(contents, topics, windows):
        schema, channel, message = shape(recorded)
        if channel.id not in channels:
            if schema is not None and schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[channel.id] = writer.register_channel(
                channel.topic,
                channel.message_encoding,
                schemas[schema.id] if schema is not None else 0,
                dict(channel.metadata),
            )
        writer.add_message(channels[channel.id], at_ns, message.data, at_ns, message.sequence)
        count += 1
    writer.add_metadata(ABOUT, {"taken": msgspec.json.encode(about).decode()})
    for metadata in contents.metadata():
        if metadata.name != ABOUT:
            writer.add_metadata(metadata.name, dict(metadata.metadata))
    writer.finish()  # type: ignore[no-untyped-call]
    return count


def topics_without_pictures(contents: Contents) -> list[str]:
    """Return the topics that have no pictures."""
    return [
        channel.topic
        for channel in contents.channels
        if (schema := contents.schema_of(channel)) is None or not is_picture(schema.name)
    ]


def parts(
    contents: Contents, topics: Collection[str] | None, windows: Sequence[tuple[int, int]]
) -> Iterator[tuple[int, Recorded]]:
    """Yield the messages of the parts with their times. Before each part comes what was latched."""
    for begin_ns, end_ns in windows:
        if begin_ns > contents.begins_ns:
            for channel in contents.channels:
                if channel.metadata.get("latching") == "1" and (topics is None or channel.topic in topics):
                    before = contents.newest(
                        channel.topic, begin_ns - 1, channel.id
                    )  # each publisher has one
                    if before is not None:
                        yield begin_ns, before
        for recorded in contents.messages(topics, begin_ns, end_ns):
            yield recorded.message.log_time, recorded
