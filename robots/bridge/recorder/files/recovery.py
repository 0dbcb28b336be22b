"""Finishes a file whose writer broke: cuts it after the last whole chunk, and writes the summary."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from typing import BinaryIO, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, MessageIndex, Metadata, MetadataIndex, Schema

from robots.bridge.recorder.files.mcap_file import CHUNK_BYTES, MAGIC, FileSummary, taken_from

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
# A chunk has one message beyond its size at most; an index is smaller
LARGEST_RECORD = 64 * 1024 * 1024 + CHUNK_BYTES


class NotRecoverable(Exception):
    """Nothing can be read from the file."""


class _Record(NamedTuple):
    opcode: int
    at: int
    content: bytes

    @property
    def length(self) -> int:
        return _HEAD.size + len(self.content)

    @property
    def stream(self) -> ReadDataStream:
        return ReadDataStream(BytesIO(self.content))


class Recovered(NamedTuple):
    """The contents of a finished file."""

    summary: FileSummary
    metadata: dict[str, dict[str, str]]  # the newest of each name
    data_end: int  # where its summary begins


def finish(file: BinaryIO) -> Recovered:
    """Finish the file, which is open for reading and writing at its beginning. Raises NotRecoverable, OSError."""
    if file.read(len(MAGIC)) != MAGIC:
        raise NotRecoverable("it does not begin as an MCAP file")
    found = _Finder()
    with suppress(_Cut):
        for record in _records(file):
            found.take(record)
    found.settle()
    recovered = Recovered(found.summary, found.metadata, found.end + len(found.missing))
    _end_with(file, found.missing, recovered)
    return recovered


def append_metadata(file: BinaryIO, to: Recovered, name: str, values: dict[str, str]) -> None:
    """Add a record of metadata to a file that was just finished."""
    builder = RecordBuilder()
    Metadata(name, values).write(builder)
    record = taken_from(builder)
    to.summary.metadata_indexes.append(MetadataIndex(to.data_end, len(record), name))
    _end_with(file, record, to._replace(data_end=to.data_end + len(record)))


def _end_with(file: BinaryIO, data: bytes, end: Recovered) -> None:
    """Write the last data, which ends at `end.data_end`, and the summary."""
    file.seek(end.data_end - len(data))
    file.truncate()
    left = memoryview(data + end.summary.encoded(end.data_end))
    while left:
        left = left[file.write(left) :]


class _Cut(Exception):
    """The file ends here, or what follows was never written."""


def _records(file: BinaryIO) -> Iterator[_Record]:
    at = len(MAGIC)
    while True:
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            raise _Cut
        opcode, length = _HEAD.unpack(head)
        if not opcode or length > LARGEST_RECORD:
            raise _Cut
        content = file.read(length)
        if len(content) < length:
            raise _Cut
        yield _Record(opcode, at, content)
        at += _HEAD.size + length


class _Finder:
    """Reads the records of data in order, as far as they are whole."""

    def __init__(self) -> None:
        self.summary = FileSummary()
        self.metadata: dict[str, dict[str, str]] = {}
        self.end = len(MAGIC)  # of the last whole record that counts
        self.missing = b""  # indexes of the last chunk, which were not written
        self._chunk: tuple[ChunkIndex, bytes] | None = None  # whose indexes are being read
        self._counts: dict[int, int] = {}

    def take(self, record: _Record) -> None:
        """Take the next record. Raises _Cut."""
        if record.opcode == Opcode.MESSAGE_INDEX:
            self._take_index(record)
        elif record.opcode in (Opcode.DATA_END, Opcode.FOOTER):
            raise _Cut
        else:
            self.settle()
            self._take(record)
        self.end = record.at + record.length

    def _take(self, record: _Record) -> None:
        try:
            match record.opcode:
                case Opcode.SCHEMA:
                    schema = Schema.read(record.stream)
                    self.summary.schemas[schema.id] = schema
                case Opcode.CHANNEL:
                    channel = Channel.read(record.stream)
                    self.summary.channels[channel.id] = channel
                case Opcode.METADATA:
                    metadata = Metadata.read(record.stream)
                    self.metadata[metadata.name] = metadata.metadata
                    self.summary.metadata_indexes.append(
                        MetadataIndex(record.at, record.length, metadata.name)
                    )
                case Opcode.CHUNK:
                    self._take_chunk(record)
        except (_Cut, MemoryError):  # the latter says nothing about the file
            raise
        except Exception as error:  # the library raises many kinds at bytes that are none of its records
            raise _Cut from error

    def _take_chunk(self, record: _Record) -> None:
        chunk = Chunk.read(record.stream)
        data = zstandard.decompress(chunk.data, chunk.uncompressed_size)
        if zlib.crc32(data) != chunk.uncompressed_crc:
            raise _Cut
        index = ChunkIndex(
            chunk_length=record.length,
            chunk_start_offset=record.at,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            message_end_time=chunk.message_end_time,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=chunk.message_start_time,
            uncompressed_size=chunk.uncompressed_size,
        )
        self._chunk, self._counts = (index, data), {}

    def _take_index(self, record: _Record) -> None:
        if self._chunk is None:
            raise _Cut
        index = self._chunk[0]
        read = MessageIndex.read(record.stream)
        index.message_index_offsets[read.channel_id] = record.at
        index.message_index_length += record.length
        self._counts[read.channel_id] = len(read.records)

    def settle(self) -> None:
        """Note the last chunk with its indexes. If the file was cut within them, they are made again."""
        if self._chunk is None:
            return
        (index, data), self._chunk = self._chunk, None
        made = _indexes(data)
        counts = {channel: len(one.records) for channel, one in made.items()}
        if counts != self._counts:
            self.end = index.chunk_start_offset + index.chunk_length
            builder = RecordBuilder()
            index.message_index_offsets.clear()
            for channel, one in made.items():
                index.message_index_offsets[channel] = self.end + builder.count
                one.write(builder)
            index.message_index_length = builder.count
            self.missing = taken_from(builder)
        self.summary.add_chunk(index, counts)


def _indexes(data: bytes) -> dict[int, MessageIndex]:
    """Return the index of each channel's messages in a chunk."""
    made: dict[int, MessageIndex] = {}
    at = 0
    while at < len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        if opcode == Opcode.MESSAGE:
            channel, _, log_ns, _ = _MESSAGE.unpack_from(data, at + _HEAD.size)
            made.setdefault(channel, MessageIndex(channel, [])).records.append((log_ns, at))
        at += _HEAD.size + length
    return made
