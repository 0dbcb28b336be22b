"""The watchdog's loop and its publishers, without a master."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest
import rospy

import robots.bridge.ros.watchdog as ros_watchdog
from robots.bridge.watchdog.process import Watchdog
from robots.bridge.watchdog.rules import Heartbeat, StopPress, StopRules
from robots.bridge.watchdog.socket import WatchdogSocket
from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros1
from robots.shared.configuration.watchdog_config import WatchdogConfig


class Robot:
    """Counts zeros."""

    def zero(self) -> int:
        return 1

    def cancel(self) -> None:
        pass

    def drive_to(self, topic: str) -> None:
        pass


class Kept:
    """A state file in memory."""

    def __init__(self) -> None:
        self.press: StopPress | None = None

    def keep(self, press: StopPress | None) -> None:
        self.press = press


@pytest.fixture
def config(tmp_path: Path) -> WatchdogConfig:
    drive = Topic("/key_vel", "geometry_msgs/Twist")
    path = str(tmp_path / "robot.stop")
    return WatchdogConfig(
        uuid4(), "tiago-1", Ros1("http://127.0.0.1:1/"), "/w", drive, (), path, str(tmp_path)
    )


@pytest.fixture
def lane(config: WatchdogConfig) -> Iterator[WatchdogSocket]:
    lane = WatchdogSocket(config.lane)
    yield lane
    lane.close()


def test_the_latch_of_an_ended_bridge_stays_in_its_state_file(
    config: WatchdogConfig, lane: WatchdogSocket
) -> None:
    """A copy in the watchdog would latch the stop again, if the stop was cleared while no watchdog ran."""
    rules, kept = StopRules(first=100), Kept()
    watchdog = Watchdog(config, rules, kept, lane, Robot())  # type: ignore[arg-type]
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as bridge:
        bridge.connect(config.lane)
        bridge.send(wire.encode(Heartbeat(publishing=True, latched=True, by="Ann")))
        while not rules.latched:
            watchdog.step(lane.wait(1.0), 10.0)
    while rules.own is None:
        watchdog.step(lane.wait(1.0), 11.0)
    assert rules.zeros(500.0)
    assert kept.press is None


def test_a_stop_that_no_bridge_has_taken_is_kept(config: WatchdogConfig, lane: WatchdogSocket) -> None:
    rules, kept = StopRules(first=100), Kept()
    watchdog = Watchdog(config, rules, kept, lane, Robot())  # type: ignore[arg-type]
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as pressing:
        pressing.connect(config.lane)
        pressing.send(wire.encode(wire.LinkStop("Ann", "smoke", press=uuid4())))
        while kept.press is None:
            watchdog.step(lane.wait(1.0), 10.0)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as bridge:
        bridge.connect(config.lane)
        bridge.send(wire.encode(Heartbeat(publishing=True, latched=True, by="Ann")))
        watchdog.step(lane.wait(1.0), 10.1)
        watchdog.step(lane.wait(1.0), 10.1)
        assert kept.press is not None, "the bridge has not written it yet"
        bridge.send(wire.encode(Heartbeat(publishing=True, latched=True, by="Ann", heard=kept.press.number)))
        while kept.press is not None:
            watchdog.step(lane.wait(1.0), 10.2)
    assert rules.own is None


def test_leaving_a_drive_topic_still_zeroes_the_other(
    config: WatchdogConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    zeroed: list[str] = []

    def publish(topic: str, _message: object) -> None:
        if topic == "/left":
            raise rospy.ROSException("publish() to a closed topic")
        zeroed.append(topic)

    monkeypatch.setattr(ros_watchdog, "publish", publish)
    monkeypatch.setattr(ros_watchdog, "heard_by", lambda topic: [] if topic == "/left" else ["base"])
    stops = ros_watchdog.WatchdogNode(config)
    stops._drives = {"/left": "/left", "/key_vel": "/key_vel"}  # type: ignore[dict-item]
    assert stops.zero() == 1
    assert zeroed == ["/key_vel"]
