"""The robot's navigation: its map, and its believed pose on it."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid
from tf2_msgs.msg import TFMessage

from robots.simulator.robot import Robot
from robots.simulator.ros.base import yaw_quaternion
from robots.simulator.sensors.survey import RESOLUTION_M, surveyed

_TOLERANCE_S = 0.5  # that much later a transform still holds, as amcl's do


class NavigationTopics:
    """A latched map of the robot's world, and the transform from map to odom."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10, tcp_nodelay=True)
        self._map = rospy.Publisher("/map", OccupancyGrid, queue_size=1, latch=True)
        self._map.publish(_drawn(robot))

    def publish(self, stamp: rospy.Time) -> None:
        """Publish the odometry's frame in the map."""
        if not self._tf.get_num_connections():
            return
        robot = self._robot
        x, y, yaw = robot.localisation.map_to_odom(robot.physics.pose)
        transform = TransformStamped()
        transform.header.stamp = stamp + rospy.Duration.from_sec(_TOLERANCE_S)
        transform.header.frame_id = "map"
        transform.child_frame_id = "odom"
        transform.transform.translation.x = x
        transform.transform.translation.y = y
        transform.transform.rotation = yaw_quaternion(yaw)
        self._tf.publish(TFMessage([transform]))


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
