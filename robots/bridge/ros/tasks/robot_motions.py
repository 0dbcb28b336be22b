"""The robot's recorded motions: reads them, asks for the space of one, performs it."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from robots.bridge.gate.arm.discs import Disc
from robots.bridge.ros.ros_worker import RateLimit, RosWorker
from robots.bridge.ros.tasks.motions import MotionTopics
from robots.bridge.ros.tasks.robot_part import Node, RobotPart
from robots.bridge.tasks.arm_clearance import ArmModel
from robots.bridge.tasks.input_routing import goal_topic
from robots.bridge.tasks.motions import MotionPlayer, Swept
from robots.shared.configuration.bridge_config import Topic
from robots.shared.wire import MotionOffer

# between two reads of the motions: a read takes up to 0.2 s, and a server may connect often
JOINED_GAP_S = 5.0
REACH_M = 1.3  # of an arm that the profile does not describe, around the middle of the base


class RobotMotions(MotionPlayer, ArmModel, RobotPart):
    """The motions of one robot, and the position of the arm that they move."""

    def __init__(self, node: Node, type: str) -> None:
        self._node = node
        self._arm = node.posture if node.config.topics.arm else None
        self._list_worker = RosWorker("motions")
        self._sweeping = RosWorker("motion")  # not on `_list_worker`, where a list may take seconds
        self._topics: MotionTopics | None = None  # a motion server may connect before it is set
        joined = RateLimit(self.read_motions, JOINED_GAP_S)
        actions = node.tasks.routing.connected("motions")  # every action that people may choose
        self._topics = MotionTopics(actions, type, node.master, node.mail, node.tasks.motions, joined.do)

    @classmethod
    def of(cls, node: Node) -> RobotMotions | None:
        """Return the motions of a robot that has some."""
        motions = node.config.topics.motions
        return cls(node, motions.type) if motions else None

    def play(self, goal_id: str, motion: str, action: str) -> None:
        if self._topics is not None:
            self._topics.play(goal_id, motion, action)

    def cancel(self, goal_id: str, action: str) -> None:
        if self._topics is not None:
            self._topics.cancel(goal_id, action)

    def read_motions(self) -> None:
        self._list_worker.do(self._read)

    def _read(self) -> None:
        if self._topics is not None:
            self._topics.read(self._offer)

    def _offer(self, action: str, motions: list[MotionOffer], text: str) -> None:
        self._node.post(lambda: self._node.tasks.capabilities.read(action, motions, text))

    def surveyed(self) -> None:
        """Read the motions if none is known yet."""
        if self._topics is not None and not any(self._topics.repertoire.values()):
            self.read_motions()

    def sweep(self, motion: str, action: str, then: Swept) -> None:
        self._sweeping.do(lambda: self._sweep(motion, action, then))

    def _sweep(self, motion: str, action: str, then: Swept) -> None:
        self._node.find_listener(goal_topic(Topic(action, "Action")).name)
        space = None
        with suppress(KeyError):
            if self._topics is not None:
                recorded, is_news = self._topics.look_up(action, motion)
                if is_news:
                    self.read_motions()
                now_s = time.monotonic()
                space = self._arm.sweep(recorded, now_s) if self._arm else ((0.0, 0.0, REACH_M),)
        self._node.post(lambda: then(space, time.monotonic()))

    def arm(self) -> tuple[Disc, ...] | None:
        return None if self._arm is None else self._arm.arm(time.monotonic())

    def arm_problem(self) -> str:
        return "" if self._arm is None else self._arm.problem(time.monotonic())

    @property
    def cancels(self) -> list[Callable[[], None]]:
        return self._topics.cancels if self._topics is not None else []
