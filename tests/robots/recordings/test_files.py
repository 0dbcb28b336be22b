"""Reading, cutting and converting the files of recordings."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from unittest import mock
from uuid import uuid4

import msgspec
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.rosbag1 import Reader
from rosbags.rosbag2 import Reader as Rosbag2

from robots.recordings.files.bag import NoBag, write_bag
from robots.recordings.files.contents import Contents, Summaries, Unreadable
from robots.recordings.files.cutting import cut, topics_without_pictures
from robots.recordings.files.decoding import Decoder, UnknownType, number_at
from robots.recordings.files.rosbag2 import for_rosbag2
from robots.shared.messages.serialization import CDR
from robots.shared.records.record_sink import TakenRecording
from tests.robots.recordings.samples import SECOND, sample


def test_a_window_and_the_newest_message_before_a_moment() -> None:
    contents = Contents(sample())
    assert [channel.topic for channel in contents.channels] == ["/camera", "/fleet/view", "/map", "/odom"]
    assert (contents.begins_ns, contents.ends_ns) == (0, 9_900_000_000)
    window = list(contents.messages(["/odom"], 3 * SECOND, 4 * SECOND))
    assert [one.message.sequence for one in window] == list(range(30, 40))
    newest = contents.newest("/odom", 5 * SECOND + 1)
    assert newest is not None and newest.message.sequence == 50
    assert contents.newest("/map", 9 * SECOND) is not None and contents.newest("/no", 9 * SECOND) is None
    assert list(contents.messages(["/odom"], 4, 4)) == []


@pytest.mark.parametrize("size", (0, 7, 100, -30))
def test_a_file_that_was_cut_is_not_read(size: int) -> None:
    with pytest.raises(Unreadable):
        Contents(io.BytesIO(sample().getvalue()[:size]))


def test_a_cut_begins_with_what_is_latched() -> None:
    contents, target = Contents(sample()), io.BytesIO()
    about = TakenRecording(uuid4(), "", "by_hand", 2.0, 3.0, 0, "", "", [])
    count = cut(
        contents,
        target,
        topics=topics_without_pictures(contents),
        windows=[(2 * SECOND, 3 * SECOND)],
        about=about,
    )
    target.seek(0)
    found = list(make_reader(target).iter_messages())
    assert count == len(found) == 1 + 10 + 10
    assert {channel.topic for _, channel, _ in found} == {"/map", "/odom", "/fleet/view"}
    assert [message.log_time for _, channel, message in found if channel.topic == "/map"] == [2 * SECOND]
    part = Contents(target)
    assert part.begins_ns == 2 * SECOND
    [told] = [one.metadata["taken"] for one in part.metadata() if one.name == "fleet"]
    assert msgspec.json.decode(told, type=TakenRecording) == about


def test_a_cut_has_what_each_publisher_latched() -> None:
    stream, target = io.BytesIO(), io.BytesIO()
    writer = Writer(stream)
    writer.start(profile="ros1", library="test")
    kind = writer.register_schema("std_msgs/String", "ros1msg", b"string data")
    for second, node in enumerate(("/base", "/camera", "/other")):
        latched = {"latching": "1", "callerid": node}
        channel = writer.register_channel("/tf_static", "ros1", kind, latched)
        text = node.encode()
        data = struct.pack("<I", len(text)) + text
        writer.add_message(channel, second * SECOND, data, second * SECOND, second)
    writer.finish()  # type: ignore[no-untyped-call]
    stream.seek(0)
    about = TakenRecording(uuid4(), "", "by_hand", 1.0, 3.0, 0, "", "", [])
    cut(Contents(stream), target, windows=[(3 * SECOND // 2, 3 * SECOND)], about=about)
    target.seek(0)
    found = [message.data[4:].decode() for _, _, message in make_reader(target).iter_messages()]
    assert sorted(found) == ["/base", "/camera", "/other"]


def test_values_of_ros_and_of_the_chain() -> None:
    contents = Contents(sample())
    for topic, path, number in (
        ("/odom", "speeds[1]", -20.0),
        ("/odom", "at.z", 2.0),
        ("/fleet/view", "state.speed", 20.0),
        ("/odom", "speeds[9]", None),
        ("/odom", "at", None),
    ):
        newest = contents.newest(topic, 2 * SECOND)
        assert newest is not None
        decoder = Decoder(newest.channel, newest.schema)
        assert number_at(decoder.read(newest.message.data), path) == number
    [odom] = [channel for channel in contents.channels if channel.topic == "/odom"]
    decoder = Decoder(odom, contents.schema_of(odom))
    assert decoder.number_fields() == ["speeds[0]", "at.x", "at.y", "at.z"]
    with pytest.raises(UnknownType):
        decoder.read(b"\x05\x00\x00\x00")


def test_a_bag_has_the_same_messages(tmp_path: Path) -> None:
    count = write_bag(Contents(sample()), tmp_path / "one.bag")
    with Reader(tmp_path / "one.bag") as bag:
        found = [(c.topic, c.msgtype, at_ns, bytes(data)) for c, at_ns, data in bag.messages()]
    assert len(found) == count == 301
    assert ("/fleet/view", "std_msgs/msg/String") in {one[:2] for one in found}
    speeds = [data for topic, _, at_ns, data in found if topic == "/odom" and at_ns == SECOND]
    assert speeds == [struct.pack("<Iddddd", 2, 10, -10, 1.0, 2.0, 1.0)]


def test_rosbag2_opens_what_is_made_for_it(tmp_path: Path) -> None:
    about = TakenRecording(uuid4(), "", "by_hand", 2.0, 3.0, 0, "", "", [])
    path = tmp_path / "one.mcap"
    with path.open("wb") as file:
        count = cut(Contents(sample(1, "cdr")), file, about=about, shape=for_rosbag2)
    with Rosbag2(path) as bag:
        found = [(one.topic, one.msgtype, bytes(data)) for one, _, data in bag.messages()]
        kept = {one.topic for one in bag.connections if one.ext.offered_qos_profiles}
    assert len(found) == count and kept == {"/map"}
    view = next(one for one in found if one[0] == "/fleet/view")
    assert view[1:] == ("std_msgs/msg/String", CDR.head + b'\x16\0\0\0{"state":{"speed":0}}\0')
    with pytest.raises(NoBag):
        cut(Contents(sample(1)), io.BytesIO(), about=about, shape=for_rosbag2)


def test_messages_of_ros_2_make_no_bag(tmp_path: Path) -> None:
    with pytest.raises(NoBag):
        write_bag(Contents(sample(1, "cdr")), tmp_path / "one.bag")


def test_the_index_of_a_file_is_read_once() -> None:
    name, stream = uuid4(), sample()
    first = Contents(stream, name)
    with mock.patch("mcap.reader._read_summary_from_stream_reader", side_effect=AssertionError):
        again = Contents(stream, name)
        assert again.summary is first.summary
        assert sum(1 for _ in again.messages(["/odom"])) == sum(1 for _ in first.messages(["/odom"])) > 0
    assert Contents(sample(5), name).ends_ns < first.ends_ns  # people were cut from it


def test_indexes_in_memory_are_bounded() -> None:
    kept = Summaries(most=1)
    for number in range(3):
        kept.put(number, Contents(sample()).summary)
    assert [kept.get(number) is not None for number in range(3)] == [False, False, True]
