"""Publishers, listeners and servers in a robot's domain. Calls return at once: DDS told all of it before."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.validate_full_topic_name import validate_full_topic_name

from robots.bridge.robot.network.velocity_sources import VELOCITIES
from robots.shared.graph import SystemState, is_own
from robots.shared.texts import MOST_NODES, MOST_TOPICS, NAME, cut

MOST_LOOKED_UP = 100  # topics whose nodes one survey asks for
UNNAMED, NO_NAME = "_NODE_NAME_UNKNOWN_", "(unnamed)"  # what rclpy says, what people read
NAMED_S = 3.0  # until the name of a new node has come; a program that is no ROS node has none
MOST_UNNAMED = 500
GOAL, SEND_GOAL, SENT = "/goal", "/_action/send_goal", "_SendGoal"


def is_valid(name: str) -> bool:
    """Return whether rclpy takes this name of a topic or service: of strangers DDS lists any."""
    try:
        return bool(validate_full_topic_name(name))
    except NameValidationException:
        return False


class Graph:
    """The domain as one node sees it."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._unnamed_s: dict[bytes, float] = {}  # since when an endpoint has no name
        self._lock = threading.Lock()

    def system(self, names: Iterable[str]) -> SystemState:
        """Return types of all topics; the nodes of these topics, and of those with velocities.

        The server of an action counts as a listener to its topic `/goal`, as on a robot with ROS 1.
        """
        topics = self._node.get_topic_names_and_types()
        types = {cut(name, NAME): cut(kinds[0], NAME) for name, kinds in topics[:MOST_TOPICS] if kinds}
        velocities = [name for name, kind in types.items() if kind in VELOCITIES and is_valid(name)]
        looked_up = list(dict.fromkeys([*names, *velocities]))
        services = dict(_first(self._node.get_service_names_and_types))
        publishers, subscribers = {}, {}
        for name in looked_up[:MOST_LOOKED_UP]:
            sending, hearing = self.publishers(name), self.subscribers(name)
            publishers[name], subscribers[name] = nodes(sending), nodes(hearing)
            action = name.removesuffix(GOAL)
            service = f"{action}{SEND_GOAL}"
            # A service has a type also if there is but a client, such as the bridge's own
            is_served = name.endswith(GOAL) and self._node.count_services(service)
            kind = services.get(service, "") if is_served else ""
            if kind.endswith(SENT):
                subscribers[name], types[name] = [action], f"{kind.removesuffix(SENT)}Goal"
            elif sending or hearing:
                types[name] = _type_of(_takers(sending, hearing) or sending + hearing)
        is_cut = len(topics) > MOST_TOPICS or len(looked_up) > MOST_LOOKED_UP
        is_cut |= any(map(self.is_crowded, looked_up[:MOST_LOOKED_UP]))
        return SystemState(publishers, subscribers, types, {}, is_cut)

    def publishers(self, topic: str) -> list[TopicEndpointInfo]:
        """Return the publishers of a topic; none if there are too many to look at."""
        if self._node.count_publishers(topic) > MOST_NODES:
            return []
        return self._known(self._node.get_publishers_info_by_topic(topic))

    def subscribers(self, topic: str) -> list[TopicEndpointInfo]:
        """Return the subscribers of a topic; none if there are too many to look at."""
        if self._node.count_subscribers(topic) > MOST_NODES:
            return []
        return self._known(self._node.get_subscriptions_info_by_topic(topic))

    def listeners(
        self, topic: str, fits: Callable[[TopicEndpointInfo], bool]
    ) -> tuple[list[TopicEndpointInfo], int]:
        """Return the subscribers of a topic that fit, and how many more are too new to have a node's name."""
        if self._node.count_subscribers(topic) > MOST_NODES:
            return [], 0
        found = self._node.get_subscriptions_info_by_topic(topic)
        fitting = list(filter(fits, found))
        known = self._known(fitting)
        return known, len(fitting) - len(known)

    def is_crowded(self, topic: str) -> bool:
        """Return whether a topic has too many publishers or subscribers to look at."""
        return bool(max(self._node.count_publishers(topic), self._node.count_subscribers(topic)) > MOST_NODES)

    def _known(self, endpoints: list[TopicEndpointInfo]) -> list[TopicEndpointInfo]:
        """Leave out those that are so new that their node's name is not known: it may be one of the console's own."""
        return [one for one in endpoints if one.node_name != UNNAMED or self._stays_unnamed(one)]

    def _stays_unnamed(self, endpoint: TopicEndpointInfo) -> bool:
        now_s = time.monotonic()
        with self._lock:
            while len(self._unnamed_s) > MOST_UNNAMED:
                del self._unnamed_s[next(iter(self._unnamed_s))]
            return now_s - self._unnamed_s.setdefault(bytes(endpoint.endpoint_gid), now_s) >= NAMED_S


def node_name(endpoint: TopicEndpointInfo) -> str:
    """Return the name of an endpoint's node, with its namespace."""
    if endpoint.node_name == UNNAMED:
        return NO_NAME
    return cut(f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}", NAME)


def nodes(endpoints: Iterable[TopicEndpointInfo]) -> list[str]:
    """Return the names of the nodes of endpoints, each once."""
    return list(dict.fromkeys(map(node_name, endpoints)))


def _type_of(endpoints: list[TopicEndpointInfo]) -> str:
    """Return the robot's type of a topic; the console's own, if the robot knows several and it is among them."""
    own = {one.topic_type for one in endpoints if is_own(node_name(one))}
    others = {one.topic_type for one in endpoints if not is_own(node_name(one))} or own
    return cut(min(own & others or others), NAME)


def _takers(sending: list[TopicEndpointInfo], hearing: list[TopicEndpointInfo]) -> list[TopicEndpointInfo]:
    """Return the robot's listeners to velocities, with the console's publishers: others may publish another type."""
    takers = [one for one in hearing if one.topic_type in VELOCITIES and not is_own(node_name(one))]
    return takers and [*takers, *(one for one in sending if is_own(node_name(one)))]


def _first(listed: Callable[[], list[tuple[str, list[str]]]]) -> Iterable[tuple[str, Any]]:
    return ((name, kinds[0]) for name, kinds in listed()[:MOST_TOPICS] if kinds)
