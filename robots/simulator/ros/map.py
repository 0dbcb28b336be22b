"""The robot's map, and its believed pose on it."""

from __future__ import annotations

import math
import queue

import rospy
from geometry_msgs.msg import Pose as RosPose
from geometry_msgs.msg import PoseWithCovarianceStamped, Vector3
from nav_msgs.msg import OccupancyGrid
from tf2_msgs.msg import TFMessage

from robots.simulator.physics.mujoco_world import Pose
from robots.simulator.robot import Robot
from robots.simulator.ros.messages import stamped, transform, yaw_quaternion
from robots.simulator.sensors.survey import RESOLUTION_M, surveyed

_TOLERANCE_S = 0.5  # a transform is valid for this time after its publication, as amcl's


class MapTopics:
    """A latched map of the robot's world, the transform from map to odom, and the believed pose, which may be set."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10, tcp_nodelay=True)
        self._map = rospy.Publisher("/map", OccupancyGrid, queue_size=1, latch=True)
        self._map.publish(_drawn(robot))
        self._pose = rospy.Publisher("/amcl_pose", PoseWithCovarianceStamped, queue_size=1, latch=True)
        self._given: queue.SimpleQueue[PoseWithCovarianceStamped] = queue.SimpleQueue()
        rospy.Subscriber("/initialpose", PoseWithCovarianceStamped, self._given.put, queue_size=1)
        self._believed: tuple[Pose, tuple[float, float]] | None = None

    def publish(self, stamp: rospy.Time) -> None:
        """Take poses that were set; publish the odometry's frame in the map, and a new believed pose."""
        while not self._given.empty():
            self._give(self._given.get())
        frame, pose = self._robot.map_to_odom(), self._robot.believed()
        if frame is None or pose is None:
            return
        self._publish_pose(stamp, pose)
        if not self._tf.get_num_connections():
            return
        placed = transform("odom", Vector3(frame.x, frame.y, 0.0), yaw_quaternion(frame.yaw))
        valid_until = stamp + rospy.Duration.from_sec(_TOLERANCE_S)
        self._tf.publish(TFMessage([stamped(placed, valid_until, "map")]))

    def _give(self, message: PoseWithCovarianceStamped) -> None:
        pose = pose_of(message.pose.pose)
        if message.header.frame_id.lstrip("/") != "map" or pose is None:
            rospy.logwarn("ignored a pose that is not in the frame 'map', or is not a number")
            return
        self._robot.localisation.give(pose, self._robot.physics.pose)

    def _publish_pose(self, stamp: rospy.Time, pose: Pose) -> None:
        """Publish the pose if it has changed: like amcl, not while the robot stands."""
        sigmas = self._robot.localisation.sigmas
        if (
            self._believed is not None
            and self._believed[1] == sigmas
            and math.dist(self._believed[0], pose) < 0.01
        ):
            return
        self._believed = pose, sigmas
        message = PoseWithCovarianceStamped()
        message.pose.pose.position.x, message.pose.pose.position.y = pose.x, pose.y
        message.pose.pose.orientation = yaw_quaternion(pose.yaw)
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = sigmas[0] ** 2
        covariance[35] = sigmas[1] ** 2
        message.pose.covariance = covariance
        self._pose.publish(stamped(message, stamp, "map"))


def pose_of(message: RosPose) -> Pose | None:
    """Return a pose on the floor; None if numbers are not finite, or the rotation is not about the vertical."""
    turn = message.orientation
    numbers = (message.position.x, message.position.y, turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, numbers)) or abs(math.hypot(turn.z, turn.w) - 1.0) > 0.01:
        return None
    return Pose(message.position.x, message.position.y, 2.0 * math.atan2(turn.z, turn.w))


def _drawn(robot: Robot) -> OccupancyGrid:
    survey = surveyed(robot.physics, robot.world.size, robot.body.laser.pose[2])
    grid = OccupancyGrid()
    grid.header.frame_id = "map"
    grid.header.stamp = grid.info.map_load_time = rospy.Time.now()
    grid.info.resolution = RESOLUTION_M
    grid.info.height, grid.info.width = survey.cells.shape
    grid.info.origin.position.x = survey.west_m
    grid.info.origin.position.y = survey.south_m
    grid.info.origin.orientation.w = 1.0
    grid.data = survey.cells.ravel().tolist()
    return grid
