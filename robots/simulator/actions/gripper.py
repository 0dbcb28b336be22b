"""The gripper's own action."""

from __future__ import annotations

from robots.simulator.actions.run_server import RunServer
from robots.simulator.joints.motions import Phase, Point, RefusedError, Run
from robots.simulator.joints.trajectories import GOAL_TOLERANCE, check, joints_of
from robots.simulator.robot import Robot
from robots.simulator.ros_side import Goal, RosSide

_FINGERS = joints_of("gripper_controller")


class GripperAction(RunServer):
    """control_msgs/GripperCommand: the position is the fingers' distance. Fingers that miss the goal have stalled."""

    def __init__(self, ros: RosSide, robot: Robot, action: str) -> None:
        super().__init__(robot.player, ros.goals(action, "control_msgs/GripperCommand"))
        self._robot = robot

    def step(self, now: float) -> None:
        """Take new goals and cancels, then report whether the goal ended."""
        if not self._robot.faults.controllers_silent:
            self.take_goals(now)

    def _begin(self, goal: Goal, now: float) -> None:
        gap_m = goal.request.command.position
        points = [Point([gap_m / len(_FINGERS)] * len(_FINGERS), 0.0)]
        try:
            check("gripper_controller", _FINGERS, points)
        except RefusedError as refused:
            goal.reject(str(refused))
            return
        self._accept(goal, self._player.follow(_FINGERS, points, now), gap_m)

    def _end(self, goal: Goal, run: Run, aim: float) -> None:
        gap_m = sum(self._player.positions[finger] for finger in _FINGERS)
        if run.phase is not Phase.DONE:
            goal.cancel(run.phase.value, position=gap_m)
        elif abs(gap_m - aim) > GOAL_TOLERANCE:
            goal.abort("", position=gap_m, stalled=True)
        else:
            goal.succeed(position=gap_m, reached_goal=True)
