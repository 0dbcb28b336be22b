"""/head_controller/point_head_action: the head turns towards a point."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import rospy

from robots.shared.ros.message_types.classes import message_class
from robots.simulator.joints.frames import FrameError, Matrix, frames, place
from robots.simulator.joints.gaze import PAN, REACHED_RAD, TILT, Eye, GazeError, aim, error, eye
from robots.simulator.joints.motions import EASED_PEAK, Phase, Point, Run
from robots.simulator.robot import Robot
from robots.simulator.ros.actions.action_server import RunServer


class HeadServer(RunServer):
    """Points the head. The aim of a goal: the eye, and the target in the base frame at the goal's arrival."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot.player, "/head_controller/point_head_action", "control_msgs/PointHeadAction")
        self._robot = robot
        self._frames = frames(robot.body)
        self._feedback = message_class("control_msgs/PointHeadFeedback")

    def publish(self, _stamp: rospy.Time) -> None:
        """Publish the head's remaining error."""
        if self._running is not None:
            handle, _, aim = self._running
            handle.publish_feedback(self._feedback(pointing_angle_error=self._off(*aim)))

    def _begin(self, handle: Any, now: float) -> None:
        goal = handle.get_goal()
        try:
            target = self._in_base(goal.target)
            axis = goal.pointing_axis
            looks = eye(self._frames, goal.pointing_frame, (axis.x, axis.y, axis.z))
            wanted = aim(self._frames, looks, target, self._player.positions)
        except (FrameError, GazeError) as refused:
            handle.set_rejected(text=str(refused))
            return
        seconds = max(goal.min_duration.to_sec(), self._shortest_s(wanted, goal.max_velocity))
        run = self._player.follow(list(wanted), [Point(list(wanted.values()), seconds)], now)
        self._accept(handle, run, (looks, target))

    def _in_base(self, target: Any) -> Matrix:
        """Return the target's point in the base frame."""
        point = np.array([target.point.x, target.point.y, target.point.z])
        if target.header.frame_id != "odom":
            return place(self._frames, target.header.frame_id, self._player.positions).point(point)
        base = self._robot.odometry
        cos, sin = math.cos(base.yaw), math.sin(base.yaw)
        ahead, left = point[0] - base.x, point[1] - base.y
        return np.array([cos * ahead + sin * left, cos * left - sin * ahead, point[2]])

    def _shortest_s(self, wanted: dict[str, float], max_velocity: float) -> float:
        """Return the shortest duration (s) with joints at most at `max_velocity` (rad/s; 0: no limit)."""
        if not max_velocity > 0.0:
            return 0.0
        way = max(abs(wanted[joint] - self._player.positions[joint]) for joint in (PAN, TILT))
        return EASED_PEAK * way / max_velocity

    def _off(self, looks: Eye, target: Matrix) -> float:
        return error(self._frames, looks, target, self._player.positions)

    def _end(self, handle: Any, run: Run, aim: tuple[Eye, Matrix]) -> None:
        if run.phase is not Phase.DONE:
            handle.set_canceled(text=run.phase.value)
        elif (off := self._off(*aim)) > REACHED_RAD:
            handle.set_aborted(text=f"the neck turns no further: {math.degrees(off):.0f} degrees off")
        else:
            handle.set_succeeded()
