"""Ground truth and control of the simulation, in a name space that the console never reads.

Published: /ground_truth/{pose,clearance,contacts,faults}. Subscribed: /ground_truth/{fault,person,teleport,battery}.
"""

from __future__ import annotations

import json
import logging
import math
import queue
from collections.abc import Callable
from typing import Any

from robots.simulator.faults import FaultError, parse_faults
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp
from robots.simulator.topics.messages import odometry

log = logging.getLogger(__name__)


class GroundTruth:
    """Publishes the robot's true pose and contacts; sets faults."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        self._touching = False
        # Messages arrive on ROS's threads; the world changes only between two ticks.
        self._asked: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._pose = ros.publisher("/ground_truth/pose", "nav_msgs/Odometry")
        self._clearance = ros.publisher("/ground_truth/clearance", "std_msgs/Float32")
        self._contacts = ros.publisher("/ground_truth/contacts", "std_msgs/String", queue=50, kept=True)
        self._faults = ros.publisher("/ground_truth/faults", "std_msgs/String", queue=5, kept=True)
        self._faults.publish(self._text("none"))
        self._obey("fault", "std_msgs/String", self._fault)
        self._obey("person", "std_msgs/String", self._person)
        self._obey("teleport", "geometry_msgs/Pose2D", self._teleport)
        self._obey("battery", "std_msgs/Float32", self._battery)

    def step(self) -> None:
        """Execute requests since the last tick."""
        while not self._asked.empty():
            self._asked.get()()

    def publish_pose(self, stamp: Stamp) -> None:
        """Publish the true pose and velocity."""
        if not self._pose.wanted:
            return
        physics, frame = self._robot.physics, self._robot.body.names.base_frame
        message = odometry(self._ros, physics.pose, physics.velocity, frame)
        self._pose.publish(self._ros.stamped(message, stamp, "world"))

    def publish_clearance(self, _stamp: Stamp) -> None:
        """Publish the gap (m) between the hull and the nearest object."""
        if self._clearance.wanted:
            gap_m = self._robot.physics.clearance_m()
            self._clearance.publish(self._ros.new("std_msgs/Float32", data=gap_m))

    def publish_contacts(self, stamp: Stamp) -> None:
        """Publish the robot's contacts in every tick with a contact, and once after the last contact.

        JSON: stamp_s; speed_mps: the robot's speed before this tick; contacts: part, with, force_n.
        """
        contacts = self._robot.physics.contacts()
        if not contacts and not self._touching:
            return
        self._touching = bool(contacts)
        approach = self._robot.approach
        message = {
            "stamp_s": stamp / 1e9,
            "speed_mps": math.hypot(approach.vx, approach.vy),
            "contacts": [
                {"part": contact.part, "with": contact.other, "force_n": round(contact.force_n, 1)}
                for contact in contacts
            ],
        }
        self._contacts.publish(self._text(json.dumps(message)))

    def _obey(self, name: str, kind: str, act: Callable[[Any], None]) -> None:
        self._ros.subscribe(
            f"/ground_truth/{name}", kind, lambda message: self._asked.put(lambda: act(message))
        )

    def _text(self, text: str) -> Any:
        return self._ros.new("std_msgs/String", data=text)

    def _fault(self, message: Any) -> None:
        """Set faults, in the format of `parse_faults`; /ground_truth/faults publishes the active faults."""
        try:
            self._robot.faults = parse_faults(message.data)
        except FaultError as error:
            log.warning("%s", error)
            return
        self._faults.publish(message)

    def _person(self, message: Any) -> None:
        """Move a person: ``NAME walk``, ``NAME stand`` or ``NAME X Y``."""
        name, _, what = message.data.partition(" ")
        walker = self._robot.people.get(name)
        if walker is None:
            log.warning("nobody is called %r here", name)
        elif what == "walk":
            walker.walk()
        elif what == "stand":
            walker.stand()
        else:
            try:
                x, y = (float(part) for part in what.split())
            except ValueError:
                log.warning("a person can walk, stand, or be at X Y; not %r", what)
                return
            walker.place(x, y)

    def _teleport(self, message: Any) -> None:
        self._robot.physics.place_robot(Pose(message.x, message.y, message.theta))
        self._robot.localisation.look_again()

    def _battery(self, message: Any) -> None:
        """Set the charge in percent; negative: dock at the charger."""
        self._robot.battery.charging = message.data < 0.0
        if message.data >= 0.0:
            self._robot.battery.percent = min(message.data, 100.0)
