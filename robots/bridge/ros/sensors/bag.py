"""Replays a rosbag of a drive to a gate, in the same way as the bridge passes data to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import rosbag

from robots.bridge.gate.arm.discs import AT_HOME, UNKNOWN, is_home
from robots.bridge.gate.gate import Gate
from robots.bridge.gate_trace import BadTrace
from robots.bridge.ros.sensors.convert import laser_scan, planar
from robots.shared.configuration.bridge_config import Topics
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.records.verdict import Verdict

TimedVerdict = tuple[float, Verdict]


def drive(file: Path, gate: Gate, topics: Topics) -> Iterator[TimedVerdict]:
    """Replay the bag to `gate`; yields the time and the verdict of each command on the drive topic.

    The bag's own times count as arrival times. The gate gets only the arm's state "at home" or "away". It
    gets no depth pictures, so it answers as with a silent camera. Raises BadTrace if the file is no bag,
    or contains no command or no odometry.
    """
    readers = _readers(gate, topics)
    sent = STILL
    seen: set[str] = set()
    try:
        with rosbag.Bag(str(file)) as bag:
            for topic, message, time in bag.read_messages([*readers, topics.drive.name]):
                seen.add(topic)
                if topic in readers:
                    readers[topic](message, time.to_sec())
                else:
                    verdict = gate.decide(_twist(message), sent, time.to_sec())
                    sent = verdict.velocity
                    yield time.to_sec(), verdict._replace(limits=gate.limits(time.to_sec()))
    except (rosbag.ROSBagException, OSError) as error:
        raise BadTrace(f"{file.name} is no rosbag, or was cut: {error}") from error
    for needed in (topics.odometry.name, topics.drive.name):
        if needed not in seen:
            raise BadTrace(f"{file.name} holds nothing on {needed}")


def _readers(gate: Gate, topics: Topics) -> dict[str, Callable[[Any, float], None]]:
    """Return the handler of each topic's messages."""
    reach_m = {sonar.frame_id: sonar.max_range_m for sonar in topics.sonars}

    def odometry(message: Any, at_s: float) -> None:
        pose, velocity = planar(message)
        gate.observe_odometry(message.header.stamp.to_sec(), at_s, pose, velocity)

    def sonar(message: Any, at_s: float) -> None:
        frame = message.header.frame_id.lstrip("/")
        most_m = reach_m.get(frame, math.inf)
        gate.observe_range(frame, message.header.stamp.to_sec(), at_s, message.range, most_m)

    def scan_of(source: str) -> Callable[[Any, float], None]:
        def scan(message: Any, at_s: float) -> None:
            gate.observe_scan(laser_scan(message, source, at_s))

        return scan

    joints: dict[str, float] = {}

    def joint_states(message: Any, at_s: float) -> None:
        joints.update(zip(message.name, message.position, strict=False))
        if topics.arm:
            home = is_home(joints, topics.arm.home, topics.arm.tolerance)
            gate.observe_posture(AT_HOME if home else UNKNOWN, at_s)

    return {
        topics.odometry.name: odometry,
        **{source.topic: sonar for source in topics.sonars},
        **{source.topic: scan_of(source.topic) for source in topics.scans},
        **({topics.joint_states.name: joint_states} if topics.joint_states else {}),
    }


def _twist(message: Any) -> Velocity:
    twist = getattr(message, "twist", message)
    return Velocity(twist.linear.x, twist.linear.y, twist.angular.z)
