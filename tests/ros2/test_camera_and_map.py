"""Camera process and map process of a robot with ROS 2, at the simulated robot."""

from __future__ import annotations

import os
import subprocess
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from websockets.sync.client import unix_connect

from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.bridge.served.client import CAMERA
from robots.shared import wire
from robots.shared.configuration.bridge_config import CameraSource, LinkAddress, Topic
from robots.shared.configuration.robot_ros import Ros2, side_command
from robots.shared.records.record_sink import TakenMap
from robots.shared.ros2.environment import MESSAGES, WHEELS, domain_environment, ros_environment
from tests.bridge.support import CONFIG
from tests.processes import PATIENCE_S, REPOSITORY
from tests.ros2.side import Side, needs_rclpy

pytestmark = needs_rclpy
CAMERAS = [
    CameraSource(
        "head",
        "/xtion/rgb/image_raw/compressed",
        "sensor_msgs/msg/CompressedImage",
        info="/xtion/rgb/camera_info",
    ),
    CameraSource("raw", "/xtion/rgb/image_raw", "sensor_msgs/msg/Image"),
    CameraSource("none", "/nobody", "sensor_msgs/msg/Image"),
]


@pytest.fixture(scope="module", autouse=True)
def robot(domain: int) -> Iterator[Side]:
    options = (
        "--ros=2",
        "--name=tiago-9",
        "--world=office",
        "--pose=2,1.8,0",
        "--seed=1",
        "--exit-with-parent",
    )
    side = Side("robots.simulator", domain, *options)
    yield side
    side.close()


def environment(domain: int) -> dict[str, str]:
    return os.environ | ros_environment([MESSAGES, WHEELS]) | domain_environment(domain)


def test_pictures_come_with_lens_and_place(domain: int, tmp_path: Path) -> None:
    config = msgspec.structs.replace(
        CONFIG,
        ros=Ros2(domain, "localhost"),
        topics=msgspec.structs.replace(CONFIG.topics, cameras=CAMERAS),
        link=LinkAddress(unix_path=str(tmp_path / "b.sock")),
    )
    command = CAMERA.command(config.ros)
    with subprocess.Popen(
        command, cwd=REPOSITORY, env=environment(domain), stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdin and process.stdout
        process.stdin.write(msgspec.json.encode(config) + b"\n")
        process.stdin.flush()
        at = msgspec.json.decode(process.stdout.readline(), type=wire.ProcessAt)
        with unix_connect(at.unix_path, compression=None, max_size=None) as socket:
            wants = {name: {"full": 30.0} for name in ("head", "raw", "none")}
            socket.send(wire.encode(wire.CameraWants(wants)).decode())
            seen: dict[str, wire.TakenPicture] = {}
            refused: dict[str, str] = {}
            others: deque[Any] = deque(maxlen=10)
            while not (seen.keys() >= {"head", "raw"} and "none" in refused and seen["head"].pose):
                message = socket.recv(timeout=PATIENCE_S)
                if isinstance(message, bytes):
                    header, picture = wire.unpacked(message)
                    seen[header.camera] = header
                    assert len(picture) > 1000
                else:
                    others.append(state := msgspec.json.decode(message, type=wire.CameraState))
                    if state.refusal:
                        refused[state.camera] = state.refusal.code
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
    assert seen["head"].lens and seen["head"].width == 640, others
    assert refused["none"] == "no_publisher"


def fetched(domain: int, topic: Topic) -> TakenMap | NoMap:
    done = subprocess.run(
        side_command(Ros2(), "sensors.map"),
        input=msgspec.json.encode(MapWanted(Ros2(domain, "localhost"), topic)),
        env=environment(domain),
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        check=True,
        timeout=PATIENCE_S,
    )
    return msgspec.msgpack.decode(done.stdout, type=TakenMap | NoMap)


def test_the_map_is_fetched_whole(domain: int) -> None:
    found = fetched(domain, Topic("/map", "nav_msgs/msg/OccupancyGrid"))
    assert isinstance(found, TakenMap), found
    assert found.resolution_m == 0.05 and found.width > 50


@pytest.mark.parametrize(
    ("name", "said"), [("/nobody", "nobody publishes /nobody"), ("/scan_raw", "it publishes sensor_msgs")]
)
def test_without_a_map_the_reason_is_said(domain: int, name: str, said: str) -> None:
    found = fetched(domain, Topic(name, "nav_msgs/msg/OccupancyGrid"))
    assert isinstance(found, NoMap) and said in found.why
