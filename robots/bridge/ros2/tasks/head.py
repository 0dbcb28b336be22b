"""Sends the head's aim: to the robot's head action while it has a server, else to the head's controller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from uuid import uuid4

from trajectory_msgs.msg import JointTrajectory

from robots.bridge.head.head import Aim
from robots.bridge.head.head_tasks import HeadMover, HeadTasks
from robots.bridge.robot.incoming.mailboxes import EVENTS_WAIT
from robots.bridge.robot.interface import Node
from robots.bridge.robot.parts import RobotPart
from robots.bridge.ros2.qos import EVENTS
from robots.bridge.ros2.tasks.actions import ActionEnds, GoalListener, joined
from robots.bridge.ros2.tasks.trajectories import fill_duration, trajectory
from robots.bridge.tasks.goals import OURS
from robots.shared.configuration.bridge_config import POINT_HEAD_2, HeadSource, Topic


class HeadEnds(HeadMover, RobotPart, GoalListener):
    """One head. Its controller takes joint positions, its action a point to look at."""

    def __init__(self, node: Node, source: HeadSource) -> None:
        self._node, self._source = node, source
        participant = joined(node).participant
        self._controller = participant.node.create_publisher(JointTrajectory, source.topic, EVENTS)
        self._action = None
        if source.point_head is not None:
            self._action = ActionEnds(participant, Topic(source.point_head, POINT_HEAD_2), self)

    @classmethod
    def of(cls, node: Node) -> HeadEnds | None:
        head = node.config.topics.head
        return cls(node, head) if head else None

    def head_at(self) -> tuple[float, float] | None:
        pan, tilt = self._node.joint(self._source.pan_joint), self._node.joint(self._source.tilt_joint)
        return None if pan is None or tilt is None else (pan, tilt)

    def aim_head(self, aim: Aim) -> str | None:
        if self._action is not None and self._action.heard:
            goal_id = f"{OURS}head-{uuid4()}"
            self._action.send(goal_id, self._goal(self._action, aim))
            return goal_id
        joints = {self._source.pan_joint: aim.pan, self._source.tilt_joint: aim.tilt}
        self._controller.publish(trajectory(joints, aim.seconds))
        return None

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return [self._action.cancel_all] if self._action is not None else []

    def _goal(self, action: ActionEnds, aim: Aim) -> Any:
        """Return the goal that points the head's own axis (the action's default) in this direction."""
        goal = action.goal_class()
        # Stamp 0: the newest transform. The base's own clock may be ahead.
        goal.target.header.frame_id = self._source.base_frame
        goal.target.point.x, goal.target.point.y, goal.target.point.z = aim.point
        fill_duration(goal.min_duration, aim.seconds)
        return goal

    # --- on the executor's thread (actions.GoalListener) -------------------------------------------------

    def running(self, action: str, goals: dict[str, int]) -> None:
        """Do nothing: a turn ends as its goal does."""

    def ended(self, goal_id: str, outcome: str, text: str, result: Any) -> None:
        self._node.mail.post(
            (self._source.point_head, "ended"),
            lambda: self._node.tasks.part(HeadTasks).ended(goal_id, outcome, text),
            EVENTS_WAIT,
        )
