"""An MCAP file opens with the library's reader, also if it was cut at any byte."""

from __future__ import annotations

import json
from pathlib import Path
from typing import BinaryIO

import pytest
from mcap.reader import SeekingReader, make_reader

from robots.bridge.recorder.files import mcap_file, recovery
from robots.bridge.recorder.files.mcap_file import McapFile

SECOND = 10**9


def _write(stream: BinaryIO, chunks: int = 3, each: int = 5) -> McapFile:
    """Write chunks of messages of two channels; the second one begins in the second chunk."""
    file = McapFile(stream, "ros1")
    file.metadata("fleet", {"taken": "begun"})
    first = file.channel(
        "/scan", "ros1", file.schema("sensor_msgs/LaserScan", "ros1msg", b"x"), {"md5sum": "0"}
    )
    second = None
    for chunk in range(chunks):
        if chunk == 1:
            second = file.channel("/fleet/view", "json", file.schema("fleet/View", "jsonschema", b"{}"), {})
        for number in range(each):
            log_ns = chunk * SECOND + number
            file.add(first, number, log_ns, b"scan %d" % log_ns)
            if second is not None:
                file.add(second, number, log_ns, json.dumps({"at": log_ns}).encode())
        file.flush()
    return file


def _read(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert isinstance(reader, SeekingReader)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        found = [
            (channel.topic, message.log_time, message.data) for _, channel, message in reader.iter_messages()
        ]
        assert summary.statistics.message_count == len(found)
        assert sum(summary.statistics.channel_message_counts.values()) == len(found)
        return found


def test_a_finished_file_opens_with_topics_and_times(tmp_path: Path) -> None:
    path = tmp_path / "whole.mcap"
    with path.open("wb", buffering=0) as stream:
        _write(stream).finish()
    found = _read(path)
    assert len(found) == 3 * 5 + 2 * 5
    assert found[0] == ("/scan", 0, b"scan 0")
    with path.open("rb") as stream:
        reader = make_reader(stream)
        late = list(reader.iter_messages(["/fleet/view"], starting_at=2 * SECOND))
        assert [message.log_time for _, _, message in late] == [2 * SECOND + number for number in range(5)]
        assert [metadata.metadata for metadata in reader.iter_metadata()] == [{"taken": "begun"}]


def test_a_file_cut_at_any_byte_opens_after_recovery(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    with path.open("wb", buffering=0) as stream:
        _write(stream).finish()
    whole = path.read_bytes()
    messages = _read(path)
    ends = [index.chunk_start_offset + index.chunk_length for index in _chunks(path)]
    for cut in [
        *range(len(mcap_file.MAGIC), len(whole), 5),
        *(end + by for end in ends for by in (-1, 0, 1)),
    ]:
        path.write_bytes(whole[:cut])
        with path.open("r+b") as stream:
            recovery.finish(stream)
        found = _read(path)
        whole_chunks = sum(end <= cut for end in ends)
        assert found == messages[: [0, 5, 15, 25][whole_chunks]], cut


def _chunks(path: Path) -> list[mcap_file.ChunkIndex]:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        return summary.chunk_indexes


@pytest.mark.parametrize(
    "tail", [b"\0" * 5000, b"\x06" + b"\xff" * 5000, b"\x06" + b"\1\0\0\0\0\0\0\0" * 700]
)
def test_what_a_power_cut_leaves_behind_is_cut_off(tmp_path: Path, tail: bytes) -> None:
    path = tmp_path / "cut.mcap"
    with path.open("wb", buffering=0) as stream:
        _write(stream)
    path.write_bytes(path.read_bytes() + tail)
    with path.open("r+b") as stream:
        assert recovery.finish(stream).metadata == {"fleet": {"taken": "begun"}}
    assert len(_read(path)) == 25


def test_a_chunk_with_other_bytes_ends_the_file(tmp_path: Path) -> None:
    path = tmp_path / "bad.mcap"
    with path.open("wb", buffering=0) as stream:
        _write(stream).finish()
    last = _chunks(path)[-1]
    bad = bytearray(path.read_bytes())
    bad[last.chunk_start_offset + last.chunk_length - 3] ^= 0xFF
    path.write_bytes(bad)
    with path.open("r+b") as stream:
        recovery.finish(stream)
    assert len(_read(path)) == 15


def test_no_mcap_file_is_not_recoverable(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(b"#ROSBAG V2.0\n")
    with path.open("r+b") as stream, pytest.raises(recovery.NotRecoverable):
        recovery.finish(stream)


def test_a_full_chunk_is_written_at_once(tmp_path: Path) -> None:
    path = tmp_path / "large.mcap"
    with path.open("wb", buffering=0) as stream:
        file = McapFile(stream)
        channel = file.channel("/image", "ros1", file.schema("sensor_msgs/Image", "ros1msg", b""), {})
        file.add(channel, 1, 1, bytes(mcap_file.CHUNK_BYTES))
        assert not file.waiting and file.at
        file.finish()
    assert [len(data) for _, _, data in _read(path)] == [mcap_file.CHUNK_BYTES]
