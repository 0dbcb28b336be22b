"""Ground truth and control of the simulation, in a name space that the console never reads.

Published: /ground_truth/{pose,clearance,contacts,faults}. Subscribed: /ground_truth/{fault,person,teleport,battery}.
"""

from __future__ import annotations

import json
import math
import queue
from collections.abc import Callable

import rospy
from geometry_msgs.msg import Pose2D
from nav_msgs.msg import Odometry
from std_msgs.msg import Float32, String

from robots.simulator.faults import FaultError, parse_faults
from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.ros.messages import odometry, stamped


class GroundTruth:
    """Publishes the robot's true pose and contacts; sets faults."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._touching = False
        # Messages arrive on rospy's threads; the world changes only between two ticks.
        self._asked: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._pose = rospy.Publisher("/ground_truth/pose", Odometry, queue_size=1, tcp_nodelay=True)
        self._clearance = rospy.Publisher("/ground_truth/clearance", Float32, queue_size=1, tcp_nodelay=True)
        self._contacts = rospy.Publisher("/ground_truth/contacts", String, queue_size=50, latch=True)
        self._faults = rospy.Publisher("/ground_truth/faults", String, queue_size=5, latch=True)
        self._faults.publish("none")
        self._obey("fault", String, self._fault)
        self._obey("person", String, self._person)
        self._obey("teleport", Pose2D, self._teleport)
        self._obey("battery", Float32, self._battery)

    def step(self) -> None:
        """Execute requests since the last tick."""
        while not self._asked.empty():
            self._asked.get()()

    def publish_pose(self, stamp: rospy.Time) -> None:
        """Publish the true pose and velocity."""
        if not self._pose.get_num_connections():
            return
        physics, frame = self._robot.physics, self._robot.body.names.base_frame
        self._pose.publish(stamped(odometry(physics.pose, physics.velocity, frame), stamp, "world"))

    def publish_clearance(self, _stamp: rospy.Time) -> None:
        """Publish the gap (m) between the hull and the nearest object."""
        if self._clearance.get_num_connections():
            self._clearance.publish(Float32(self._robot.physics.clearance_m()))

    def publish_contacts(self, stamp: rospy.Time) -> None:
        """Publish the robot's contacts in every tick with a contact, and once after the last contact.

        JSON: stamp_s; speed_mps: the robot's speed before this tick; contacts: part, with, force_n.
        """
        contacts = self._robot.physics.contacts()
        if not contacts and not self._touching:
            return
        self._touching = bool(contacts)
        approach = self._robot.approach
        message = {
            "stamp_s": stamp.to_sec(),
            "speed_mps": math.hypot(approach.vx, approach.vy),
            "contacts": [
                {"part": contact.part, "with": contact.other, "force_n": round(contact.force_n, 1)}
                for contact in contacts
            ],
        }
        self._contacts.publish(json.dumps(message))

    def _obey(self, name: str, kind: type, act: Callable[[object], None]) -> None:
        rospy.Subscriber(f"/ground_truth/{name}", kind, lambda message: self._asked.put(lambda: act(message)))

    def _fault(self, message: String) -> None:
        """Set faults, in the format of `parse_faults`; /ground_truth/faults publishes the active faults."""
        try:
            self._robot.faults = parse_faults(message.data)
        except FaultError as error:
            rospy.logwarn("%s", error)
            return
        self._faults.publish(message.data)

    def _person(self, message: String) -> None:
        """Move a person: ``NAME walk``, ``NAME stand`` or ``NAME X Y``."""
        name, _, what = message.data.partition(" ")
        walker = self._robot.people.get(name)
        if walker is None:
            rospy.logwarn("nobody is called %r here", name)
        elif what == "walk":
            walker.walk()
        elif what == "stand":
            walker.stand()
        else:
            try:
                x, y = (float(part) for part in what.split())
            except ValueError:
                rospy.logwarn("a person can walk, stand, or be at X Y; not %r", what)
                return
            walker.place(x, y)

    def _teleport(self, message: Pose2D) -> None:
        self._robot.physics.place_robot(Pose(message.x, message.y, message.theta))
        self._robot.localisation.look_again()

    def _battery(self, message: Float32) -> None:
        """Set the charge in percent; negative: dock at the charger."""
        self._robot.battery.charging = message.data < 0.0
        if message.data >= 0.0:
            self._robot.battery.percent = min(message.data, 100.0)
