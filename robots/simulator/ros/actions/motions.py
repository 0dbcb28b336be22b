"""The /play_motion action and its services."""

from __future__ import annotations

from typing import Any

import rospy

from robots.shared.ros.message_types.classes import message_class, service_class
from robots.simulator.joints.motions import ErrorCode, Phase, RefusedError, Run
from robots.simulator.robot import Robot
from robots.simulator.ros.actions.action_server import Goals


class MotionServer:
    """Performs goals."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._player = robot.player
        self._result = message_class("play_motion_msgs/PlayMotionResult")
        self._info = message_class("play_motion_msgs/MotionInfo")
        self._running: list[tuple[Any, Run]] = []
        list_motions = service_class("play_motion_msgs/ListMotions")
        is_already_there = service_class("play_motion_msgs/IsAlreadyThere")
        rospy.Service("/play_motion/list_motions", list_motions, self._list)
        rospy.Service("/play_motion/is_already_there", is_already_there, self._is_already_there)
        self._goals = Goals("/play_motion", "play_motion_msgs/PlayMotionAction")

    def step(self, now: float) -> None:
        """Take new goals and cancels, then report which motions ended."""
        for is_goal, handle in self._goals.arrived():
            if is_goal:
                self._begin(handle, now)
            else:
                self._cancel(handle)
        for handle, run in self._running[:]:
            if run.phase is not Phase.MOVING:
                self._running.remove((handle, run))
                self._report_end(handle, run)

    def _begin(self, handle: Any, now: float) -> None:
        name = handle.get_goal().motion_name
        try:
            run = self._player.start(name, now, fails=self._robot.faults.motion_fails)
        except RefusedError as refused:
            handle.set_rejected(self._result(int(refused.code), str(refused)), str(refused))
            return
        handle.set_accepted()
        self._running.append((handle, run))

    def _cancel(self, handle: Any) -> None:
        for running, run in self._running[:]:
            if running == handle:
                self._player.cancel(run)
                self._running.remove((running, run))
                running.set_canceled(self._result(), "cancelled")

    def _report_end(self, handle: Any, run: Run) -> None:
        if run.phase is Phase.DONE:
            handle.set_succeeded(self._result(int(ErrorCode.SUCCEEDED), ""))
        else:
            text = "the joints did not reach their goal"
            handle.set_aborted(self._result(int(ErrorCode.GOAL_NOT_REACHED), text), text)

    def _list(self, _request: Any) -> Any:
        # Every duration stays 0, as in play_motion.
        infos = [self._info(name=name, joints=motion.joints) for name, motion in self._player.motions.items()]
        return {"motions": infos}

    def _is_already_there(self, request: Any) -> Any:
        try:
            return {"already_there": self._player.is_there(request.motion_name, request.tolerance)}
        except RefusedError as refused:
            raise rospy.ServiceException(str(refused)) from refused
