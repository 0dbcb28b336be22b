"""Cancels of goals: of one goal, or of all goals of each action that the robot's domain offers, as a stop must."""

from __future__ import annotations

import logging
import math
import random
import time
from collections.abc import Iterable
from typing import Any

import numpy as np
from action_msgs.srv import CancelGoal
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from robots.bridge.ros2.network.graph import is_valid
from robots.bridge.ros2.qos import CANCELS

log = logging.getLogger(__name__)

CANCEL, KIND = "/_action/cancel_goal", "action_msgs/srv/CancelGoal"
MOST_ACTIONS = 128  # beside those of the configuration: a stranger may serve thousands
MOST_LOOKED_UP = 128  # new names whose servers one look counts
MOST_MADE = 32  # clients of one look: each takes the computer a millisecond
LOOK_S = 2.0  # between two looks
SHARE = 0.02  # of the time, at most, that looks take


class _NotRead(ReentrantCallbackGroup):  # type: ignore[misc]
    """Lets no executor read."""

    def can_execute(self, entity: Any) -> bool:
        """Return False."""
        return False


_NOT_READ = _NotRead()


def cancel_client(node: Node, action: str) -> Any:
    """Return a client that cancels goals of an action. Its answers, which may have any size, are never read."""
    return node.create_client(CancelGoal, f"{action}{CANCEL}", qos_profile=CANCELS, callback_group=_NOT_READ)


def cancel_goals(clients: Iterable[Any], goal: bytes = bytes(16)) -> None:
    """Cancel one goal of these actions; without an id all goals, from any sender (zero id and zero stamp).

    Nobody asks whether there is a server: that takes long where strangers have thousands, and DDS keeps no request.
    """
    request = CancelGoal.Request()
    request.goal_info.goal_id.uuid = np.frombuffer(goal, np.uint8)
    for client in clients:
        try:
            # Nobody reads the answer: a server that never answers must not leave one waiting for each stop.
            client.remove_pending_request(client.call_async(request))
        except Exception:  # the other actions' goals are cancelled all the same
            log.exception("goals of one action were not cancelled")


class Cancels:
    """Cancels all goals: of the configured actions, and of those found in the domain.

    One thread looks for these, so that their clients are there when a stop comes; another one cancels.
    """

    def __init__(self, node: Node, actions: Iterable[str], namespace: str) -> None:
        self._node, self._within = node, f"{namespace}/"
        self._configured = {action: cancel_client(node, action) for action in actions}
        self._found: dict[str, Any] = {}  # clients by action; who came first stays
        self._due_s = -math.inf
        self.is_full = False  # more actions are served

    def cancel_all(self) -> None:
        """Cancel the goals of all clients, as an emergency stop must."""
        cancel_goals([*self._configured.values(), *self._found.values()])

    def look(self) -> None:
        """Have a client for each action that is served now, if it is time for a look."""
        begin_s = time.monotonic()
        if begin_s < self._due_s:
            return
        try:
            self._follow()
        except Exception:  # what strangers call their services
            log.exception("the servers of actions cannot be read")
        now_s = time.monotonic()
        self._due_s = now_s + max(LOOK_S, (now_s - begin_s) / SHARE)

    def _follow(self) -> None:
        gone = {action: client for action, client in self._found.items() if not self._is_served(action)}
        self._found = {action: client for action, client in self._found.items() if action not in gone}
        for client in gone.values():
            self._node.destroy_client(client)
        listed = self._node.get_service_names_and_types()
        cancels = [name for name, kinds in listed if name.endswith(CANCEL) and KIND in kinds]
        names = {name.removesuffix(CANCEL) for name in cancels if is_valid(name)}
        new = [one for one in names if one.startswith(self._within)]
        new = [one for one in new if one not in self._found and one not in self._configured]
        random.shuffle(new)  # names without a server, of a stranger, must not always come first
        # A service is listed also if there is but a client, such as this one's
        served = [action for action in new[:MOST_LOOKED_UP] if self._is_served(action)]
        room = MOST_ACTIONS - len(self._found)
        self.is_full = len(served) > room or len(new) > MOST_LOOKED_UP
        for action in served[: min(room, MOST_MADE)]:
            self._found = {**self._found, action: cancel_client(self._node, action)}

    def _is_served(self, action: str) -> bool:
        return bool(self._node.count_services(f"{action}{CANCEL}"))
