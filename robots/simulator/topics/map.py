"""The robot's map, and its believed pose on it."""

from __future__ import annotations

import logging
import math
import queue
from array import array
from typing import Any

from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp
from robots.simulator.sensors.survey import RESOLUTION_M, surveyed
from robots.simulator.topics.messages import pose_of, transform, yaw_quaternion

log = logging.getLogger(__name__)

_TOLERANCE_NS = 500_000_000  # a transform is valid for this time after its publication, as amcl's

POSE = "geometry_msgs/PoseWithCovarianceStamped"


class MapTopics:
    """A latched map of the robot's world, the transform from map to odom, and the believed pose, which may be set."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        self._tf = ros.publisher("/tf", "tf2_msgs/TFMessage", queue=10)
        self._map = ros.publisher("/map", "nav_msgs/OccupancyGrid", kept=True)
        self._map.publish(_drawn(ros, robot))
        self._pose = ros.publisher("/amcl_pose", POSE, kept=True)
        self._given: queue.SimpleQueue[Any] = queue.SimpleQueue()
        ros.subscribe("/initialpose", POSE, self._given.put, queue=1)
        self._believed: tuple[Pose, tuple[float, float]] | None = None

    def publish(self, stamp: Stamp) -> None:
        """Take poses that were set; publish the odometry's frame in the map, and a new believed pose."""
        while not self._given.empty():
            self._give(self._given.get())
        frame, pose = self._robot.map_to_odom(), self._robot.believed()
        if frame is None or pose is None:
            return
        self._publish_pose(stamp, pose)
        if not self._tf.wanted:
            return
        turned = yaw_quaternion(self._ros, frame.yaw)
        placed = transform(self._ros, "odom", (frame.x, frame.y, 0.0), turned)
        self._ros.stamped(placed, stamp + _TOLERANCE_NS, "map")
        self._tf.publish(self._ros.new("tf2_msgs/TFMessage", transforms=[placed]))

    def _give(self, message: Any) -> None:
        pose = pose_of(message.pose.pose)
        if message.header.frame_id.lstrip("/") != "map" or pose is None:
            log.warning("ignored a pose that is not in the frame 'map', or is not a number")
            return
        self._robot.localisation.give(pose, self._robot.physics.pose)

    def _publish_pose(self, stamp: Stamp, pose: Pose) -> None:
        """Publish the pose if it has changed: like amcl, not while the robot stands."""
        sigmas = self._robot.localisation.sigmas
        if (
            self._believed is not None
            and self._believed[1] == sigmas
            and math.dist(self._believed[0], pose) < 0.01
        ):
            return
        self._believed = pose, sigmas
        message = self._ros.new(POSE)
        message.pose.pose.position.x, message.pose.pose.position.y = pose.x, pose.y
        message.pose.pose.orientation = yaw_quaternion(self._ros, pose.yaw)
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = sigmas[0] ** 2
        covariance[35] = sigmas[1] ** 2
        message.pose.covariance = covariance
        self._pose.publish(self._ros.stamped(message, stamp, "map"))


def _drawn(ros: RosSide, robot: Robot) -> Any:
    survey = surveyed(robot.physics, robot.world.size, robot.body.laser.pose[2])
    grid = ros.stamped(ros.new("nav_msgs/OccupancyGrid"), ros.now(), "map")
    grid.info.map_load_time = grid.header.stamp
    grid.info.resolution = RESOLUTION_M
    grid.info.height, grid.info.width = survey.cells.shape
    grid.info.origin.position.x = survey.west_m
    grid.info.origin.position.y = survey.south_m
    grid.info.origin.orientation.w = 1.0
    grid.data = array("b", survey.cells.tobytes())
    return grid
