"""The robot's map, and its camera's pictures, from the robot to who looks at them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest
from websockets.sync.client import unix_connect

from robots.bridge.maps.map_fetch import MapWanted, NoMap
from robots.bridge.served.client import CAMERA
from robots.shared import wire
from robots.shared.configuration.bridge_config import CameraSource, LinkAddress, Topic
from robots.shared.configuration.robot_ros import side_command
from robots.shared.processes.probe_findings import BRIDGE
from robots.shared.records.record_sink import TakenMap
from tests.forked import ForkedProgram, answer_of, forks_of
from tests.processes import PATIENCE_S, until
from tests.ros.bridge_support import running_bridge
from tests.sides.side import Side
from tests.sides.visitor import Visitor

GRID, IMAGE = "nav_msgs/OccupancyGrid", "sensor_msgs/Image"


@pytest.fixture(scope="module")
def robot(simulator: Callable[..., Any]) -> Any:
    return simulator(world="office", pose="2,1.8,0", seed=1)


def test_a_bridge_takes_the_map_when_control_is_taken(
    side: Side, robot: Any, visitor: Visitor, tmp_path: Path
) -> None:
    def hears_tf() -> list[bool]:
        return [BRIDGE in visitor.listeners(topic) for topic in ("/tf", "/tf_static")]

    with running_bridge(side.config(tmp_path, "map"), side, tmp_path) as (bridge, hand):
        hand.state_until(lambda state: state.phase == "online", "a robot")
        assert "map 200 x 140" not in bridge.recorded()
        assert not all(hears_tf())
        hand.take_control(7)
        until(lambda: "map 200 x 140" in bridge.recorded(), "a map")
        until(lambda: all(hears_tf()), "it hears where the odometry is on the map")
        hand.send(wire.Revoke(7, "the test is over"))
        until(lambda: not any(hears_tf()), "it leaves the robot alone")


@pytest.mark.parametrize(
    ("name", "said"), [("/nobody", "nobody publishes /nobody"), ("/scan_raw", "sensor_msgs")]
)
def test_a_missing_map_is_explained(side: Side, robot: Any, name: str, said: str) -> None:
    answer = answer_of(
        side_command(side.ros, "sensors.map")[-1],
        msgspec.json.encode(MapWanted(side.ros, Topic(name, side.type(GRID)))),
        side.environment(),
        forks_of(side.ros),
    )
    found = msgspec.msgpack.decode(answer, type=TakenMap | NoMap)
    assert isinstance(found, NoMap) and said in found.why


def test_pictures_come_with_lens_and_place(side: Side, robot: Any, tmp_path: Path) -> None:
    (head,) = side.topics.cameras
    cameras = [
        head,
        CameraSource("raw", "/xtion/rgb/image_raw", side.type(IMAGE)),
        CameraSource("none", "/nobody", side.type(IMAGE)),
    ]
    config = side.config(
        tmp_path, topics={"cameras": cameras}, link=LinkAddress(unix_path=str(tmp_path / "b.sock"))
    )
    program, environment = CAMERA.command(side.ros)[-1], side.environment()
    process = ForkedProgram(program, environment=environment, forks=forks_of(side.ros), talks=True)
    with process.stdout, process.stdin:
        process.stdin.write(msgspec.json.encode(config) + b"\n")
        process.stdin.flush()
        at = msgspec.json.decode(process.stdout.readline(), type=wire.ProcessAt)
        seen: dict[str, wire.TakenPicture] = {}
        refused: dict[str, str] = {}
        with unix_connect(at.unix_path, compression=None, max_size=None) as socket:
            wants = {camera.name: {"full": 30.0} for camera in cameras}
            socket.send(wire.encode(wire.CameraWants(wants)).decode())
            while not (seen.keys() >= {"head", "raw"} and "none" in refused and seen["head"].pose):
                message = socket.recv(timeout=PATIENCE_S)
                if isinstance(message, bytes):
                    header, picture = wire.unpacked(message)
                    seen[header.camera] = header
                    assert len(picture) > 1000
                    continue
                with suppress(msgspec.ValidationError):  # another message
                    state = msgspec.json.decode(message, type=wire.CameraState)
                    if state.refusal:
                        refused[state.camera] = state.refusal.code
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
    assert seen["head"].lens and seen["head"].width == 640
    assert refused["none"] == "no_publisher"
