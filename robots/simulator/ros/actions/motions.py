"""The /play_motion action and its services."""

from __future__ import annotations

from typing import Any

import rospy

from robots.shared.ros.message_types.classes import service_class
from robots.simulator.actions.motions import MotionServer
from robots.simulator.joints.motions import RefusedError
from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide


class PlayMotionServer(MotionServer):
    """play_motion."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        list_motions = service_class("play_motion_msgs/ListMotions")
        is_already_there = service_class("play_motion_msgs/IsAlreadyThere")
        rospy.Service("/play_motion/list_motions", list_motions, self._list)
        rospy.Service("/play_motion/is_already_there", is_already_there, self._is_already_there)
        super().__init__(robot, ros.goals("/play_motion", "play_motion_msgs/PlayMotion"))

    def _result(self, code: int, text: str) -> dict[str, Any]:
        return {"error_code": code, "error_string": text}

    def _list(self, _request: Any) -> Any:
        # Every duration stays 0, as in play_motion.
        motions = self._player.motions.items()
        return {
            "motions": [
                self._ros.new("play_motion_msgs/MotionInfo", name=name, joints=motion.joints)
                for name, motion in motions
            ]
        }

    def _is_already_there(self, request: Any) -> Any:
        try:
            return {"already_there": self._player.is_there(request.motion_name, request.tolerance)}
        except RefusedError as refused:
            raise rospy.ServiceException(str(refused)) from refused
