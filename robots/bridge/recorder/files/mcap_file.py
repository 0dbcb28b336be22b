"""Writes an MCAP file so that a cut one can be finished: each chunk, with its index, goes to the file in one write.

Schemas and channels stand before the first chunk that needs them. Pictures have chunks of their own: who reads
anything else reads a small part of the file. The summary at the end is made from what the writer
remembers; `recovery` makes it from the file.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.summary import Summary

from robots.bridge.recorder.black_box.ring import is_picture

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 4 * 1024 * 1024
LIBRARY = "fleet console"
MOST_CHANNELS = 65_000  # ids have two bytes
_INDEX_BYTES, _OFFSET_BYTES = 600, 64  # memory of a chunk's index, and of each channel in it
_LEVEL = 1  # of zstd: pictures do not shrink, and everything else shrinks well enough
_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_FIXED = _MESSAGE.size - 9  # of the length


def taken_from(builder: RecordBuilder) -> bytes:
    """Return the bytes of a builder, which is empty then."""
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


class _Chunk:
    """The messages of a chunk that is not written yet."""

    def __init__(self) -> None:
        self.size = 0
        self.pieces: list[bytes] = []
        self.indexes: dict[int, MessageIndex] = {}
        self.begins = self.ends = 0

    def add(self, channel: int, sequence: int, log_ns: int, data: bytes) -> None:
        index = self.indexes.get(channel)
        if index is None:
            index = self.indexes[channel] = MessageIndex(channel, [])
        index.records.append((log_ns, self.size))
        self.begins = min(self.begins, log_ns) if self.pieces else log_ns
        self.ends = max(self.ends, log_ns)
        length = _FIXED + len(data)
        head = _MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence & 0xFFFFFFFF, log_ns, log_ns)
        self.pieces += head, data
        self.size += len(head) + len(data)


class FileSummary(Summary):
    """The summary section of a file."""

    def __init__(self) -> None:
        super().__init__()
        self.statistics: Statistics = Statistics(0, 0, defaultdict(int), 0, 0, 0, 0, 0, 0)
        self.index_bytes = 0  # memory of the indexes of chunks, roughly

    def add_chunk(self, index: ChunkIndex, counts: Mapping[int, int]) -> None:
        """Note a chunk. `counts`: its messages of each channel."""
        self.chunk_indexes.append(index)
        self.index_bytes += _INDEX_BYTES + _OFFSET_BYTES * len(index.message_index_offsets)
        stands = self.statistics
        first = stands.message_count == 0
        begins, ends = index.message_start_time, index.message_end_time
        stands.message_start_time = begins if first else min(stands.message_start_time, begins)
        stands.message_end_time = max(stands.message_end_time, ends)
        stands.message_count += sum(counts.values())
        for channel, count in counts.items():
            stands.channel_message_counts[channel] += count

    def encoded(self, begins_at: int) -> bytes:
        """Return everything after the last record of data, from `begins_at` in the file to its end."""
        stands = self.statistics
        stands.schema_count, stands.channel_count = len(self.schemas), len(self.channels)
        stands.chunk_count, stands.metadata_count = len(self.chunk_indexes), len(self.metadata_indexes)
        end = RecordBuilder()
        DataEnd(0).write(end)
        data_end = taken_from(end)
        summary_at = begins_at + len(data_end)
        builder = RecordBuilder()
        offsets = []
        groups = (
            (Opcode.SCHEMA, list(self.schemas.values())),
            (Opcode.CHANNEL, list(self.channels.values())),
            (Opcode.STATISTICS, [stands]),
            (Opcode.CHUNK_INDEX, self.chunk_indexes),
            (Opcode.METADATA_INDEX, self.metadata_indexes),
        )
        for opcode, records in groups:
            start = builder.count
            for record in records:
                record.write(builder)
            if builder.count > start:
                offsets.append(SummaryOffset(opcode, summary_at + start, builder.count - start))
        offsets_at = summary_at + builder.count
        for offset in offsets:
            offset.write(builder)
        summary = taken_from(builder)
        checked = summary + struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, summary_at, offsets_at)
        Footer(summary_at, offsets_at, zlib.crc32(checked)).write(end)
        return b"".join((data_end, summary, taken_from(end), MAGIC))


class McapFile:
    """One file that is being written. Nothing reaches the disk before `flush` or `finish`.

    After an OSError the file may end within a record: `recovery.finish` finishes it, also later.
    """

    def __init__(self, stream: BinaryIO, profile: str = "") -> None:
        self.summary = FileSummary()
        self.at = 0  # bytes that were written
        self._stream = stream
        self._compress: Callable[[bytes], bytes] = zstandard.ZstdCompressor(_LEVEL).compress
        self._head = RecordBuilder()  # records before the next chunk
        self._pictures: set[int] = set()  # channels
        self._chunks = {False: _Chunk(), True: _Chunk()}  # by whether it has pictures
        self._head.write(MAGIC)
        Header(profile, LIBRARY).write(self._head)

    @property
    def waiting(self) -> int:
        """Bytes that wait for `flush`, before compression."""
        return sum(chunk.size for chunk in self._chunks.values())

    def schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema; return its id."""
        schema = Schema(id=len(self.summary.schemas) + 1, data=data, encoding=encoding, name=name)
        self.summary.schemas[schema.id] = schema
        schema.write(self._head)
        return schema.id

    def channel(self, topic: str, encoding: str, schema: int, metadata: dict[str, str]) -> int:
        """Add a channel; return its id."""
        channel = Channel(len(self.summary.channels) + 1, topic, encoding, metadata, schema)
        self.summary.channels[channel.id] = channel
        channel.write(self._head)
        if is_picture(self.summary.schemas[schema].name):
            self._pictures.add(channel.id)
        return channel.id

    def add(self, channel: int, sequence: int, log_ns: int, data: bytes) -> None:
        """Add a message, and write the chunk if it is full."""
        kind = channel in self._pictures
        self._chunks[kind].add(channel, sequence, log_ns, data)
        if self._chunks[kind].size >= CHUNK_BYTES:
            self._flush(kind)

    def metadata(self, name: str, values: dict[str, str]) -> None:
        """Add a record of metadata, and write it with all that waits."""
        self.flush()
        start = self._head.count
        Metadata(name, values).write(self._head)
        self.summary.metadata_indexes.append(MetadataIndex(self.at + start, self._head.count - start, name))
        self._write(taken_from(self._head))

    def flush(self) -> None:
        """Write what waits."""
        for kind, chunk in self._chunks.items():
            if chunk.pieces:
                self._flush(kind)

    def _flush(self, kind: bool) -> None:
        """Write what waits for a chunk."""
        waits = self._chunks[kind]
        data = b"".join(waits.pieces)
        packed = self._compress(data)
        chunk = Chunk("zstd", packed, waits.ends, waits.begins, zlib.crc32(data), len(data))
        builder = self._head
        chunk_at = builder.count
        chunk.write(builder)
        index_at = builder.count
        offsets = {}
        for channel, index in waits.indexes.items():
            offsets[channel] = self.at + builder.count
            index.write(builder)
        entry = ChunkIndex(
            chunk_length=index_at - chunk_at,
            chunk_start_offset=self.at + chunk_at,
            compression="zstd",
            compressed_size=len(packed),
            message_end_time=waits.ends,
            message_index_length=builder.count - index_at,
            message_index_offsets=offsets,
            message_start_time=waits.begins,
            uncompressed_size=len(data),
        )
        counts = {channel: len(index.records) for channel, index in waits.indexes.items()}
        self._chunks[kind] = _Chunk()
        self._write(taken_from(builder))
        self.summary.add_chunk(entry, counts)

    def finish(self) -> None:
        """Write all that waits, and the summary."""
        self.flush()
        self._write(taken_from(self._head))
        self._write(self.summary.encoded(self.at))

    def _write(self, data: bytes) -> None:
        left = memoryview(data)
        while left:  # an unbuffered file takes a part if the disk is nearly full
            left = left[self._stream.write(left) :]
        self.at += len(data)
