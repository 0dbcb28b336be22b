"""Topics of sensors that are always read: odometry, lasers, sonars, battery, charger, diagnostics, joints."""

from __future__ import annotations

import time
from collections import Counter, OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from robots.bridge.robot.incoming.reception import DIAGNOSTICS_WAIT, ODOMETRY_WAITS, Reception
from robots.bridge.robot.sensors.diagnostics import statuses
from robots.bridge.robot.sensors.joints import JointReception
from robots.bridge.ros2.participant import Participant, Take
from robots.bridge.ros2.qos import sensor
from robots.bridge.ros2.sensors import brief
from robots.shared.configuration.bridge_config import Topics

JOINTS_WAIT = 10  # messages: each publisher may report other joints
SONAR_ROUNDS = 3  # readings of each sonar in its topic's queue
KNOWN = 4  # newest publishers of odometry: two that publish in turn must not count as new each time


class SensorTopics:
    """Reads them on the executor's thread. `node_of` names the node of a publisher."""

    def __init__(
        self,
        topics: Topics,
        reception: Reception,
        joints: JointReception | None,
        node_of: Callable[[Any], str],
        on_new_run: Callable[[], None],
    ) -> None:
        self._topics, self._reception, self._arm = topics, reception, joints
        self._node_of, self._on_new_run = node_of, on_new_run
        self._joints = brief.JointStates()
        self._number = 0  # of the last odometry message
        self._run = 0
        self.runs: OrderedDict[bytes | None, tuple[int, float]] = (
            OrderedDict()
        )  # by publisher; last heard (s)

    def listen(self, participant: Participant) -> None:
        """Subscribe."""
        topics = self._topics

        def listen(name: str, type_name: str, take: Take, depth: int = 1) -> None:
            participant.listen(name, type_name, take, sensor(depth))

        # Delayed messages arrive all at once. A dropped one is a gap in odometry, and a gap clears the gate's memory.
        listen(topics.odometry.name, topics.odometry.type, self._on_odometry, ODOMETRY_WAITS)
        for scan in topics.scans:
            listen(scan.topic, "sensor_msgs/msg/LaserScan", partial(self._on_scan, scan.topic))
        for name, sonars in Counter(sonar.topic for sonar in topics.sonars).items():
            # Sonars that share a topic publish together: no reading may push another out of the queue.
            listen(name, "sensor_msgs/msg/Range", self._on_range, SONAR_ROUNDS * sonars)
        if battery := topics.battery:
            listen(battery.name, battery.type, partial(self._on_battery, battery.type))
        if charging := topics.charging:
            listen(charging.name, charging.type, self._on_charging)
        if diagnostics := topics.diagnostics:
            listen(diagnostics.name, diagnostics.type, self._on_diagnostics, DIAGNOSTICS_WAIT)
        if topics.joint_states and self._arm:
            listen(topics.joint_states.name, topics.joint_states.type, self._on_joints, JOINTS_WAIT)

    # --- on the executor's thread ----------------------------------------------------------------------

    def _on_odometry(self, raw: bytes, info: Any) -> None:
        stamp_s, pose, velocity = brief.odometry(raw)
        self._reception.odometry(stamp_s, pose, velocity, self._run_of(info))

    def _on_scan(self, source: str, raw: bytes, _info: Any) -> None:
        self._reception.scan(brief.scan(raw, source, time.monotonic()))

    def _on_range(self, raw: bytes, _info: Any) -> None:
        self._reception.range(*brief.sonar(raw))

    def _on_battery(self, type_name: str, raw: bytes, _info: Any) -> None:
        self._reception.battery(brief.battery(raw, type_name))

    def _on_charging(self, raw: bytes, _info: Any) -> None:
        self._reception.charging(brief.is_true(raw))

    def _on_diagnostics(self, raw: bytes, info: Any) -> None:
        message = deserialize_message(raw, DiagnosticArray)
        self._reception.diagnostics(statuses(message, self._node_of(info)))

    def _on_joints(self, raw: bytes, _info: Any) -> None:
        if self._arm is not None:
            self._arm.joints(self._joints.positions(raw))

    def _run_of(self, info: Any) -> int:
        """Return the run of the odometry's publisher: a restarted one has another address in the domain (GID).

        Before Jazzy rclpy does not tell it; then a restarted publisher counts its messages from the first again.
        """
        gid = info.get("publisher_gid")
        publisher = bytes(gid["data"]) if gid else None
        number = info.get("publication_sequence_number") or 0
        known = self.runs.get(publisher)
        if known is None or (publisher is None and number < self._number):
            self._run += 1
            known = self._run, 0.0
            if self._run > 1:
                self._on_new_run()
        self.runs[publisher] = known[0], time.monotonic()
        self.runs.move_to_end(publisher)
        while len(self.runs) > KNOWN:
            self.runs.popitem(last=False)
        self._number = number
        return known[0]
