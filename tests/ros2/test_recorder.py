"""The recorder of a ROS 2 robot, at the simulated robot: its files are those of rosbag2, with definitions."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from robots.bridge.recorder.recorder_messages import InControl
from robots.recordings.files.bag import NoBag, write_bag
from robots.recordings.files.contents import Contents
from robots.recordings.files.decoding import Decoder
from robots.shared.records.record_sink import TakenRecording
from robots.shared.ros2.environment import SOCKET_BYTES
from robots.shared.wire import BlackBoxState
from tests.processes import PATIENCE_S, until
from tests.recorder_process import RecorderProcess, ends_with_its_robot, messages_of
from tests.ros2.conftest import OPTIONS, free_domain
from tests.ros2.side import Side, needs_rclpy
from tests.sides.side import Ros2Side
from tests.sides.visitor import Visitor

ODOMETRY, MAP, CAMERA = "/mobile_base_controller/odom", "/map", "/xtion/rgb/image_raw/compressed"
RMEM_MAX = int(Path("/proc/sys/net/core/rmem_max").read_text())
PICTURE_BYTES = 640 * 480 * 4

pytestmark = needs_rclpy


@pytest.fixture(scope="module")
def recorder(network: Ros2Side, robot: Side, short_folder: Path):
    process = recorder_in(network, short_folder)
    yield process
    process.stop()


def recorder_in(network: Ros2Side, folder: Path) -> RecorderProcess:
    return RecorderProcess(network.config(folder), network.environment(), folder)


def read_by_rosbag2(path: Path, topic: str) -> list[bytes]:
    with Reader(path) as reader:
        found = [one for one in reader.connections if one.topic == topic]
        return [bytes(data) for _, _, data in reader.messages(found)]


def test_a_recording_has_cdr_and_whole_definitions(recorder: RecorderProcess, tmp_path: Path) -> None:
    def recorded() -> TakenRecording | None:
        recording = recorder.begins([ODOMETRY, MAP, CAMERA])
        until(lambda: recorder.bytes > 100_000, "pictures", PATIENCE_S)
        taken = recorder.finishes(recording)
        return taken if {ODOMETRY, MAP, CAMERA} <= {one.topic for one in taken.topics} else None

    taken = until(recorded, "all topics", PATIENCE_S)
    assert taken.dropped == 0 and taken.thumbnail
    with (recorder.directory / taken.name).open("rb") as stream:
        assert make_reader(stream).get_header().profile == "ros2"
        contents = Contents(stream)
        assert {channel.topic for channel in contents.channels} >= {ODOMETRY, MAP, CAMERA}
        for topic, kind in ((ODOMETRY, "nav_msgs/msg/Odometry"), (MAP, "nav_msgs/msg/OccupancyGrid")):
            found = contents.newest(topic, contents.ends_ns)
            assert found is not None and found.schema is not None
            assert (found.schema.name, found.schema.encoding) == (kind, "ros2msg")
            assert found.channel.message_encoding == "cdr"
            assert Decoder(found.channel, found.schema).read(found.message.data).header.frame_id
            assert found.message.data == read_by_rosbag2(recorder.directory / taken.name, topic)[-1]
        with pytest.raises(NoBag):
            write_bag(contents, tmp_path / "one.bag")


def test_a_pressed_bumper_is_an_event_and_others_topics_are_found(
    recorder: RecorderProcess, visitor: Visitor
) -> None:
    recorder.say(InControl("person-1", "session-1"))
    recording = recorder.begins("pictures_not")
    with visitor.speak("/bumper_front", "std_msgs/Bool") as bumper:
        bumper.publish(data=True)
        until(lambda: box(recorder).keeps == "contact", "the contact", PATIENCE_S)
    topics = {one.topic for one in recorder.finishes(recording).topics}
    assert {"/bumper_front", "/tf", "/scan_raw"} <= topics and CAMERA not in topics
    assert not [topic for topic in topics if "/_action/" in topic]


@pytest.mark.skipif(RMEM_MAX < SOCKET_BYTES, reason="this computer's sockets are too small: docs/limits.md")
def test_large_pictures_come_though_nobody_sends_them_again(recorder: RecorderProcess, domain: int) -> None:
    topic, count = "/wrist_camera/depth", 12
    recording = recorder.begins([topic])
    with closing(Side("tests.ros2.pictures_side", domain, str(domain), topic, str(count))) as camera:
        camera.await_line("published")
        found = messages_of(recorder.directory / recorder.finishes(recording).name)[topic]
    assert len(found) >= 0.8 * count  # with the kernel's usual sockets at most a third came
    assert all(len(data) > PICTURE_BYTES for _, data in found)


def test_recordings_end_with_the_robot(tmp_path: Path) -> None:
    with free_domain() as domain:
        robot = Side("robots.simulator", domain, *OPTIONS)
        try:
            ends_with_its_robot(recorder_in(Ros2Side(domain), tmp_path), robot.close)
        finally:
            robot.close()


def box(recorder: RecorderProcess) -> BlackBoxState:
    return recorder.progress.black_box or BlackBoxState()
