"""/head_controller/point_head_action: the head turns towards a point."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robots.simulator.actions.run_server import RunServer
from robots.simulator.joints.frames import FrameError, Matrix, frames, place
from robots.simulator.joints.gaze import PAN, REACHED_RAD, TILT, Eye, GazeError, aim, error, eye
from robots.simulator.joints.motions import EASED_PEAK, Phase, Point, Run
from robots.simulator.robot import Robot
from robots.simulator.ros_side import Goal, RosSide, Stamp


class HeadServer(RunServer):
    """Points the head. The aim of a goal: the eye, and the target in the base frame at the goal's arrival."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        goals = ros.goals("/head_controller/point_head_action", "control_msgs/PointHead")
        super().__init__(robot.player, goals)
        self._ros = ros
        self._robot = robot
        self._frames = frames(robot.body)

    def publish(self, _stamp: Stamp) -> None:
        """Publish the head's remaining error."""
        if self._running is not None:
            goal, _, aim = self._running
            goal.feedback(pointing_angle_error=self._off(*aim))

    def _begin(self, goal: Goal, now: float) -> None:
        asked = goal.request
        try:
            target = self._in_base(asked.target)
            axis = asked.pointing_axis
            looks = eye(self._frames, asked.pointing_frame, (axis.x, axis.y, axis.z))
            wanted = aim(self._frames, looks, target, self._player.positions)
        except (FrameError, GazeError) as refused:
            goal.reject(str(refused))
            return
        seconds = max(self._ros.seconds(asked.min_duration), self._shortest_s(wanted, asked.max_velocity))
        run = self._player.follow(list(wanted), [Point(list(wanted.values()), seconds)], now)
        self._accept(goal, run, (looks, target))

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

    def _end(self, goal: Goal, run: Run, aim: tuple[Eye, Matrix]) -> None:
        if run.phase is not Phase.DONE:
            goal.cancel(run.phase.value)
        elif (off := self._off(*aim)) > REACHED_RAD:
            goal.abort(f"the neck turns no further: {math.degrees(off):.0f} degrees off")
        else:
            goal.succeed()
