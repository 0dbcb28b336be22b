"""The bridge's rclpy node: subscribes to one robot's topics and publishes to its drive topic.

The first part of the interface of `robots.bridge.ros.node.RosBase`: drive topic, odometry, lasers, cancels of actions.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from robots.bridge.core import Core
from robots.bridge.robot.mailboxes import Mailboxes
from robots.bridge.ros2.participant import Participant, guarded
from robots.bridge.ros2.qos import DRIVE, sensor
from robots.bridge.ros2.sensors import brief
from robots.shared.configuration.bridge_config import Topics
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.processes.probe_findings import BRIDGE

log = logging.getLogger(__name__)

ODOMETRY_WAITS = 20  # messages in the queue: the gate pairs scans with all of them
PUBLISHERS = 4
LEAVE_S = 1.0
FLUSH_S = 0.1


class RosBase:
    """The robot's ROS interface for `Core`. Passes data from the executor's thread to `Core` on the event loop."""

    def __init__(self, topics: Topics, domain: int, namespace: str = "/") -> None:
        self._topics = topics
        self._domain, self._namespace = domain, namespace
        self._stamped = topics.drive.type == "geometry_msgs/TwistStamped"
        self._participant: Participant | None = None
        self._drive: Any = None
        self._cancels: list[Any] = []
        self._run, self._number = 0, 0  # of the odometry's publisher; of its last message
        # The newest publishers: two that publish in turn must not count as new each time.
        self._publishers: deque[bytes | None] = deque(maxlen=PUBLISHERS)
        self.mail = Mailboxes(self.post, lambda: self._core.needs_fresh_sensors)
        self._loop: asyncio.AbstractEventLoop
        self._core: Core
        self._run_on_loop: Callable[[Callable[[], None]], None]

    # --- called by Core ----------------------------------------------------------------------------

    def publish(self, velocity: Velocity) -> None:
        """Publish a twist if the drive topic is connected."""
        if self._drive is not None:
            self._drive.publish(self._twist(velocity))

    def take_odometry(self) -> None:
        """Handle odometry that has arrived and waits for the event loop."""
        try:
            self.mail.take("odometry")
        except Exception:  # the decision that needs it must be made
            log.exception("odometry could not be handled")

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must: with zero id and zero stamp."""
        for client in self._cancels:
            if client.service_is_ready():
                # Nobody reads the answer: a server that never answers must not leave one waiting for each stop.
                client.remove_pending_request(client.call_async(CancelGoal.Request()))

    @property
    def listeners(self) -> int:
        """Return the number of the robot's nodes that listen to the drive topic."""
        return 0 if self._drive is None else int(self._drive.get_subscription_count())

    # --- life ----------------------------------------------------------------------------------------

    def start(
        self,
        loop: asyncio.AbstractEventLoop,
        core: Core,
        run_on_loop: Callable[[Callable[[], None]], None],
    ) -> None:
        """Join the robot's domain. `run_on_loop` runs calls with the robot's data on the loop."""
        self._loop, self._core, self._run_on_loop = loop, core, run_on_loop
        self._participant = participant = Participant(BRIDGE.strip("/"), self._namespace, self._domain)
        node, topics = participant.node, self._topics
        node.create_subscription(
            Odometry, topics.odometry.name, guarded(self._on_odometry), sensor(ODOMETRY_WAITS), raw=True
        )
        for scan in topics.scans:
            node.create_subscription(
                LaserScan, scan.topic, guarded(self._on_scan(scan.topic)), sensor(1), raw=True
            )
        self._cancels = [
            node.create_client(CancelGoal, f"{action}/_action/cancel_goal") for action in topics.cancelled
        ]
        self._drive = node.create_publisher(
            TwistStamped if self._stamped else Twist, topics.drive.name, DRIVE
        )
        participant.start()

    def stop(self) -> None:
        """Publish zero and leave the domain."""
        if self._participant is None:
            return
        self.publish(STILL)
        time.sleep(FLUSH_S)  # the zero leaves before the participant does
        self._participant.close(LEAVE_S)

    # --- on the executor's thread ----------------------------------------------------------------------

    def _on_odometry(self, raw: bytes, info: Any) -> None:
        arrival_s, wall_s = time.monotonic(), time.time()
        stamp_s, pose, velocity = brief.odometry(raw)
        run = self._run_of(info)
        self.mail.post(
            "odometry",
            lambda: self._core.odometry(stamp_s, arrival_s, pose, velocity, wall_s, run),
            ODOMETRY_WAITS,
            can_wait=True,
        )

    def _on_scan(self, source: str) -> Callable[[bytes], None]:
        def receive(raw: bytes) -> None:
            scan = brief.scan(raw, source, time.monotonic())
            self.mail.post(source, lambda: self._core.laser(scan))

        return receive

    def _run_of(self, info: Any) -> int:
        """Return the run of the odometry's publisher: a restarted one has another address in the domain (GID).

        Before Jazzy rclpy does not tell it; then a restarted publisher counts its messages from the first again.
        """
        gid = info.get("publisher_gid")
        number = info.get("publication_sequence_number") or 0
        publisher = bytes(gid["data"]) if gid else None
        if publisher not in self._publishers or (publisher is None and number < self._number):
            self._run += 1
            self._publishers.append(publisher)
        self._number = number
        return self._run

    def post(self, call: Callable[[], None]) -> None:
        """Run a call on the event loop."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._run_on_loop, call)

    def _twist(self, velocity: Velocity) -> Twist | TwistStamped:
        twist = Twist()
        twist.linear.x, twist.linear.y, twist.angular.z = map(float, velocity)
        if not self._stamped or self._participant is None:
            return twist
        stamped = TwistStamped(twist=twist)
        stamped.header.stamp = self._participant.node.get_clock().now().to_msg()
        return stamped
