"""Writes what stays of a recording as a new file, in the order of the old one.

Before each time that stays comes what its topics had latched, such as the map: what follows cannot be read without.
"""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Sequence
from typing import BinaryIO

import msgspec
from mcap.reader import make_reader
from mcap.records import Channel, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from msgspec import structs

from robots.bridge.recorder.erasing.nameless import Nameless
from robots.bridge.recorder.files.mcap_file import McapFile
from robots.bridge.recorder.recorder_messages import CHANNELS
from robots.shared import wire
from robots.shared.records.record_sink import ABOUT, FileCut, RecordedTopic, TakenRecording

CUT = "fleet_cut"  # name of metadata


def rewrite(source: BinaryIO, target: BinaryIO, cut: FileCut) -> TakenRecording:
    """Write what stays; return what the new file is (0 bytes: nothing stays). Raises McapError, OSError."""
    records = StreamReader(source).records
    header = next(records)
    rest = _Rest(McapFile(target, header.profile if isinstance(header, Header) else ""), cut.stays)
    about: dict[str, dict[str, str]] = {}  # the newest of each name
    for record in records:
        match record:
            case Schema():
                rest.schemas[record.id] = record
            case Channel():
                rest.channels[record.id] = record
            case Message():
                rest.take(record)
            case Metadata():
                about[record.name] = record.metadata
    return rest.finished(cut.taken, about | {CUT: _note(cut)})


def done_before(source: BinaryIO, cut: FileCut) -> TakenRecording | None:
    """Return what the file is if it was cut like this already; None: it was not. Raises McapError, OSError."""
    notes = {note.name: note.metadata for note in make_reader(source).iter_metadata()}
    source.seek(0)
    if notes.get(CUT) != _note(cut):
        return None
    taken = msgspec.json.decode(notes[ABOUT]["taken"], type=TakenRecording)
    return structs.replace(taken, bytes=os.fstat(source.fileno()).st_size)


def _note(cut: FileCut) -> dict[str, str]:
    """Return the metadata of a file that was cut: a digest of what it was told, which tells nobody anything."""
    taken = cut.taken
    told = [cut.stays, taken.person, taken.session, taken.booking, taken.reason, taken.events]
    return {"told": hashlib.sha256(wire.encode(told)).hexdigest()}


class _Rest:
    """The new file while it is written."""

    def __init__(self, file: McapFile, stays: Sequence[tuple[int, int]]) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._file = file
        self._stays = stays
        self._begun: set[int] = set()  # beginnings of times that have a message
        self._latched: dict[int, Message] = {}  # by channel, for the next time that stays
        self._written: dict[int, int] = {}  # ids in the new file, by those in the old one
        self._new_schemas: dict[int, int] = {}
        self._counts: Counter[int] = Counter()
        self._nameless = Nameless()

    def take(self, message: Message) -> None:
        """Take the next message of the old file."""
        at_ns = message.log_time
        begin_ns = next((begin for begin, end in self._stays if begin <= at_ns < end), None)
        if begin_ns is None:
            if self.channels[message.channel_id].metadata.get("latching") == "1":
                self._latch(message)
            return
        if begin_ns not in self._begun:
            self._begun.add(begin_ns)
            for latched in [one for one in self._latched.values() if one.log_time < begin_ns]:
                self._add(self._latched.pop(latched.channel_id), begin_ns)
        self._add(message, at_ns)

    def _latch(self, message: Message) -> None:
        """Keep a latched message that does not stay for the next time that does.

        Chunks are not in the order of time, so that time may have begun.
        """
        later = [begin_ns for begin_ns in self._begun if begin_ns > message.log_time]
        if later:
            self._add(message, min(later))
        else:
            self._latched[message.channel_id] = message

    def _add(self, message: Message, at_ns: int) -> None:
        channel = self.channels[message.channel_id]
        if channel.id not in self._written:
            self._written[channel.id] = self._file.channel(
                channel.topic, channel.message_encoding, self._schema(channel), channel.metadata
            )
        data = self._nameless(message.data) if channel.topic in CHANNELS else message.data
        self._file.add(self._written[channel.id], message.sequence, at_ns, data)
        self._counts[channel.id] += 1

    def _schema(self, channel: Channel) -> int:
        schema = self.schemas.get(channel.schema_id)
        if schema is None:
            return 0
        if schema.id not in self._new_schemas:
            self._new_schemas[schema.id] = self._file.schema(schema.name, schema.encoding, schema.data)
        return self._new_schemas[schema.id]

    def finished(self, taken: TakenRecording, about: dict[str, dict[str, str]]) -> TakenRecording:
        """Write metadata and summary; return what the file is."""
        self._file.flush()
        stands = self._file.summary.statistics
        if not stands.message_count:
            return structs.replace(taken, bytes=0, topics=[])
        taken = structs.replace(
            taken,
            bytes=0,
            begins=stands.message_start_time / 1e9,
            ends=stands.message_end_time / 1e9,
            topics=self._topics(taken.topics),
        )
        for name, values in about.items():
            if name != ABOUT:
                self._file.metadata(name, values)
        self._file.metadata(ABOUT, {"taken": wire.encode(taken).decode()})
        self._file.finish()
        return structs.replace(taken, bytes=self._file.at)

    def _topics(self, before: list[RecordedTopic]) -> list[RecordedTopic]:
        counts: Counter[tuple[str, str]] = Counter()
        for number, count in self._counts.items():
            channel = self.channels[number]
            schema = self.schemas.get(channel.schema_id)
            counts[channel.topic, schema.name if schema else ""] += count
        dropped = {(one.topic, one.type): one.dropped for one in before}
        return [RecordedTopic(*key, count, dropped.get(key, 0)) for key, count in sorted(counts.items())]
