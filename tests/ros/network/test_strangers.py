"""A bridge that its network attacks runs on, needs little memory, reports bad messages, and can stop the robot."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import DepthSource, Topic
from robots.shared.configuration.gate_profile import DepthView
from tests.processes import PATIENCE_S
from tests.ros import strangers
from tests.ros.bridge_support import BridgeProcess, Hand, drivable, running_bridge, tiago_config

LARGEST_STATE = 16 * 1024  # bytes on the link
GROWN = 60 * 1024 * 1024  # bytes: the most memory that an attack may add


@pytest.fixture(scope="module")
def attacked(make_master, simulator, tmp_path_factory):
    """A robot on a separate master, its bridge and a driving link."""
    master, folder = make_master(), tmp_path_factory.mktemp("attacked")
    simulator(master=master, name="attacked")
    topics = {
        "motions": Topic("/play_motion", "play_motion_msgs/PlayMotionAction"),
        "depth": DepthSource("/nobody/depth", "sensor_msgs/Image"),  # makes the bridge subscribe to tf
    }
    config = tiago_config(master, folder, topics=topics, gate={"depth": DepthView(height_m=1.5)})
    with running_bridge(config, master, folder) as (bridge, hand):
        hand.state_until(drivable, "a robot that can be driven")
        yield SimpleNamespace(master=master, bridge=bridge, hand=hand)


def memory(bridge: BridgeProcess) -> int:
    """Resident memory, bytes."""
    pages = int(Path(f"/proc/{bridge.process.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def goes_on(attacked, hand: Hand) -> None:
    """Check that the bridge runs and still sends small states."""
    assert attacked.bridge.process.poll() is None, attacked.bridge.log.read_text()[-2000:]
    state = hand.state_until(lambda state: True, "a state")
    assert len(wire.encode(state)) < LARGEST_STATE


SAID = {
    strangers.long_name: lambda state: any(name.endswith("…") for name in state.foreign),
    strangers.long_type: lambda state: "/long_type" in state.foreign,
    strangers.long_result: lambda state: (
        "/play_motion/result: /long_result sends messages of 18 MB" in state.text
    ),
    strangers.huge_scans: lambda state: "/scan_raw: /huge_scans_1 sends messages of 12 MB" in state.text,
    strangers.declared_scan: lambda state: (
        "/scan_raw: /declared_scan_1 sends messages of 4.29 GB" in state.text
    ),
    strangers.tiny_messages: lambda state: "sends more than 1000 messages a second" in state.text,
    strangers.fast_scans: lambda state: "/scan_raw: /fast_scans " in state.text,
    strangers.declared_header: lambda state: True,
    strangers.silent_listeners: lambda state: True,
    strangers.declared_call: lambda state: True,
    strangers.false_publishers: lambda state: True,
}


@pytest.mark.parametrize("attack", SAID, ids=lambda attack: attack.__name__)
def test_a_stranger_neither_ends_nor_fills_the_bridge(
    attacked, attack: Callable, request: pytest.FixtureRequest
):
    hand, before = attacked.hand, memory(attacked.bridge)
    with attack(attacked.master.uri):
        hand.send(wire.LinkStop("Ann", "a test", seq=1))
        hand.state_until(lambda state: state.stop.state == "stopped", "standstill")
        hand.state_until(SAID[attack], f"what is said of {attack.__name__}")
        goes_on(attacked, hand)
        assert memory(attacked.bridge) - before < GROWN
    number = hand.state.stop.number
    hand.send(wire.LinkClear("Ann", number, seq=2))
    hand.state_until(lambda state: state.stop.state == "clear" and drivable(state), "a robot to be driven")


def test_endless_frames_neither_fill_nor_stop_the_bridge(attacked):
    hand = attacked.hand
    hand.take_control(fence=10)
    before = memory(attacked.bridge)
    with strangers.frames(attacked.master.uri) as node:
        hand.drive_until(
            0.2,
            lambda state: "tf has too many frames" in state.text and node.sent > 300,
            "that tf is full",
        )
        assert memory(attacked.bridge) - before < GROWN
        goes_on(attacked, hand)
    hand.stick(0.0)
    hand.send(wire.Revoke(10, "the test is over"))


def test_a_cut_off_publisher_is_heard_again_when_it_behaves(attacked):
    """The publisher first sends a broken message, later correct battery levels."""
    hand, levels = attacked.hand, iter([b"\xff" * 4, *[strangers.framed(b"\0\0\x28\x42")] * 1000])
    with strangers.Node(attacked.master.uri, "/mended") as node:
        node.publish("/power/battery_level", "std_msgs/Float32", lambda: levels, 10.0)
        hand.state_until(
            lambda state: "/mended sends messages of 4.29 GB" in state.text, "why it is not heard"
        )
        hand.state_until(lambda state: state.battery_percent == 42.0, "its level")


@pytest.mark.last  # the bridge ends
def test_a_bridge_out_of_memory_leaves_the_robot_at_zero(attacked):
    """A laser sends the largest allowed scans to a bridge with a low memory limit."""
    bridge, hand = attacked.bridge, attacked.hand
    hand.take_control(fence=20)
    with strangers.Listener(attacked.master.uri) as heard:
        hand.drive_until(0.3, lambda state: state.odometry.vx > 0.05, "a robot that drives")
        _, hard = resource.prlimit(bridge.process.pid, resource.RLIMIT_DATA)
        resource.prlimit(bridge.process.pid, resource.RLIMIT_DATA, (1024 * 1024, hard))
        with strangers.huge_scans(attacked.master.uri, beams=20_000, rate_hz=5.0):
            assert bridge.process.wait(PATIENCE_S) is not None
        assert heard.ended.wait(PATIENCE_S)
    assert heard.last == bytes(48)
    log = bridge.log.read_text()
    assert "no memory is left" in log or "MemoryError" in log
