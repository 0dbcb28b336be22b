"""The /play_motion2 action, its services and its parameters."""

from __future__ import annotations

from typing import Any

from robots.simulator.actions.motions import MotionServer
from robots.simulator.joints.motions import ErrorCode, Motion
from robots.simulator.robot import Robot
from robots.simulator.ros2.side import RclpySide


class PlayMotion2Server(MotionServer):
    """play_motion2."""

    def __init__(self, ros: RclpySide, robot: Robot) -> None:
        node = ros.add_node("play_motion2")
        for name, motion in robot.player.motions.items():
            for key, value in parameters(motion).items():
                node.declare_parameter(f"motions.{name}.{key}", value)
        ros.serve(node, "/play_motion2/list_motions", "play_motion2_msgs/ListMotions", self._list)
        ros.serve(node, "/play_motion2/is_motion_ready", "play_motion2_msgs/IsMotionReady", self._is_ready)
        super().__init__(robot, ros.goals("/play_motion2", "play_motion2_msgs/PlayMotion2", node))

    def _result(self, code: int, text: str) -> dict[str, Any]:
        return {"success": code == ErrorCode.SUCCEEDED, "error": text}

    def _list(self, _request: Any, answer: Any) -> Any:
        answer.motion_keys = list(self._player.motions)
        return answer

    def _is_ready(self, request: Any, answer: Any) -> Any:
        answer.is_ready = self._player.is_ready(request.motion_key)
        return answer


def parameters(motion: Motion) -> dict[str, Any]:
    """Return a motion as parameters of play_motion2: positions of all points in one list."""
    return {
        "joints": list(motion.joints),
        "positions": [position for point in motion.points for position in point.positions],
        "times_from_start": [point.time_from_start for point in motion.points],
        "meta.name": motion.meta.name,
        "meta.usage": motion.meta.usage,
        "meta.description": motion.meta.description,
    }
