"""Finishes the files of processes that broke, and reads what a finished file says of itself."""

from __future__ import annotations

import errno
import logging
from collections.abc import Iterator
from pathlib import Path
from uuid import UUID

import msgspec
from mcap.exceptions import McapError
from mcap.reader import make_reader
from msgspec import structs

from robots.bridge.recorder.black_box.ring import Message, Origin, is_picture
from robots.bridge.recorder.files import recovery
from robots.bridge.recorder.files.directory import FILE, NEW, PICTURE, Draft, RecordingDirectory
from robots.bridge.recorder.files.thumbnail import thumbnail_of
from robots.bridge.recorder.take import DROPPED
from robots.shared import wire
from robots.shared.records.record_sink import ABOUT, RecordedTopic, TakenRecording

log = logging.getLogger(__name__)

_taken = msgspec.json.Decoder(TakenRecording)


def finish_cut(directory: RecordingDirectory) -> Iterator[UUID]:
    """Finish the cut files, and yield their recordings. A file without any message is removed. Raises OSError."""
    if not directory.path.exists():
        return
    for draft in directory.cut():
        try:
            taken = _finished(draft)
        except OSError as error:
            draft.stream.close()
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                log.warning("%s is finished later: %s", draft.path.name, error)
                continue
            raise
        except MemoryError:
            draft.stream.close()
            log.warning("%s is finished later: there is too little memory", draft.path.name)
            continue
        if taken is None:
            log.warning("%s has nothing in it, and is removed", draft.path.name)
            draft.path.unlink(missing_ok=True)
            draft.path.with_suffix(NEW).unlink(missing_ok=True)
            draft.stream.close()
        else:
            directory.publish(draft)
            yield taken.recording


def _finished(draft: Draft) -> TakenRecording | None:
    """Finish a file; return what it is. None: it has no message."""
    try:
        found = recovery.finish(draft.stream)
        taken = _taken.decode(found.metadata[ABOUT]["taken"])
    except (recovery.NotRecoverable, KeyError, msgspec.DecodeError):
        return None
    stands = found.summary.statistics
    if not stands.message_count:
        return None
    dropped = found.metadata.get(DROPPED, {})
    topics: dict[tuple[str, str], int] = {}
    for number, count in stands.channel_message_counts.items():
        channel = found.summary.channels[number]
        key = channel.topic, found.summary.schemas[channel.schema_id].name
        topics[key] = topics.get(key, 0) + count
    taken = structs.replace(
        taken,
        begins=stands.message_start_time / 1e9,
        ends=stands.message_end_time / 1e9,
        topics=[
            RecordedTopic(*key, messages=count, dropped=int(dropped.get(" ".join(key), 0)))
            for key, count in sorted(topics.items())
        ],
        dropped=sum(map(int, dropped.values())),
        name=draft.path.with_suffix(FILE).name,
        cut=not taken.name,  # the last words of a whole file have its name
        thumbnail=taken.thumbnail or make_picture(draft.path),
    )
    recovery.append_metadata(draft.stream, found, ABOUT, {"taken": wire.encode(taken).decode()})
    return taken


def make_picture(path: Path) -> bool:
    """Write the small picture beside a finished file, from its last picture. Return False: it has none."""
    with path.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        if summary is None:
            return False
        kinds = {one.topic: summary.schemas[one.schema_id].name for one in summary.channels.values()}
        pictures = [topic for topic, kind in kinds.items() if is_picture(kind)]
        for topic in sorted(pictures):
            for schema, channel, message in reader.iter_messages([topic], reverse=True):
                origin = Origin(topic, channel.message_encoding, schema.name if schema else "", "", "")
                picture = thumbnail_of(Message(origin, 0, 0, message.data))
                if picture is not None:
                    path.with_suffix(PICTURE).write_bytes(picture)
                    return True
                break
    return False


def without_row(directory: RecordingDirectory) -> Iterator[TakenRecording]:
    """Yield the finished recordings that have no row yet. Raises OSError."""
    if directory.path.exists():
        for path in directory.without_row():
            if (taken := read(path)) is not None:
                yield taken


def read(path: Path) -> TakenRecording | None:
    """Return what a finished file is; None if it is none of a recorder's."""
    with path.open("rb") as stream:
        try:
            found = [one for one in make_reader(stream).iter_metadata() if one.name == ABOUT]
            taken = _taken.decode(found[-1].metadata["taken"])
        except (McapError, IndexError, KeyError, msgspec.DecodeError) as error:
            log.warning("%s cannot be read: %s", path.name, error)
            return None
        return structs.replace(taken, name=path.name, directory=str(path.parent), bytes=path.stat().st_size)
