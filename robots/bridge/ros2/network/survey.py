"""The robot's nodes in its domain, and what of them does not fit the console."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from typing import Any

from rclpy.topic_endpoint_info import TopicEndpointInfo

from robots.bridge.ros2.drive import kind_heard, kind_of
from robots.bridge.ros2.network.graph import Graph, node_name
from robots.bridge.ros2.network.offers import refused
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.qos import DRIVE
from robots.shared.configuration.bridge_config import Topic, Topics
from robots.shared.graph import is_own
from robots.shared.processes.probe_findings import BRIDGE
from robots.shared.sentences import say
from robots.shared.texts import NAME, cut

log = logging.getLogger(__name__)

FOUND_S = 4.0  # until a robot that is there has been found, also by a busy computer
QUIET_S = 0.3  # without anything new in the domain: then all has been found
FIND_S = 0.02  # between two looks for it
GONE_S = 25.0  # by which a process that was killed has left the domain
LOOK_S, SOON_S = 1.0, 0.03  # between two looks at listeners whose number stays; changes


def find_robot(participant: Participant, topics: Topics) -> bool:
    """Wait until the robot was found with all that it has, `FOUND_S` at most. Return whether it is there."""
    node, graph = participant.node, Graph(participant.node)
    count, changed_s = 0, (begin_s := time.monotonic())
    while (now_s := time.monotonic()) < begin_s + FOUND_S:
        listed = (
            node.get_node_names(),
            node.get_topic_names_and_types(),
            node.get_service_names_and_types(),
        )
        if (found := sum(map(len, listed))) != count:
            count, changed_s = found, now_s
        elif now_s >= changed_s + QUIET_S and is_there(graph, topics, topics.drive.name):
            return True
        time.sleep(FIND_S)
    return is_there(graph, topics, topics.drive.name)


def is_there(graph: Graph, topics: Topics, drive: str) -> bool:
    """Return whether the robot publishes odometry, or listens to the drive topic. A crowd may hide it."""
    odometry = topics.odometry.name
    if graph.is_crowded(odometry) or graph.is_crowded(drive):
        return True
    return bool(_others(graph.publishers(odometry)) or _others(graph.subscribers(drive)))


def wanted_kind(graph: Graph, drive: Topic, now: str) -> str:
    """Return the type of velocities that the robot takes on a topic; `now` if that cannot be read, or not yet."""
    try:
        if graph.listeners(drive.name, _connects(now))[1]:  # has no name yet: it may be the robot's
            return now
        listeners = _others(graph.subscribers(drive.name))
    except Exception:  # what strangers call their nodes
        log.exception("who listens to %s cannot be read", drive.name)
        return now
    return kind_heard(drive, [one.topic_type for one in listeners], now)


class Problems:
    """Faults of the domain: nodes that do not fit the console."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._alone_s = time.monotonic()  # when no other bridge published velocities

    def of(self, drive: str, kind: str) -> list[str]:
        """Return a sentence for each listener that gets no velocity of this type, and for a second bridge."""
        listeners = _others(self._graph.subscribers(drive))
        fitting = [one for one in listeners if one.topic_type == kind]
        words = "{node} gets nothing on {topic}: it asks for {policy} {asked}, the console offers {offered}."
        found: list[str] = [
            say(words, node=one.node, topic=drive, policy=one.policy, asked=one.asked, offered=one.offered)
            for one in refused(DRIVE, fitting)
        ]
        words = "{node} gets nothing on {topic}: it takes {found}, but others take {type}."
        found += [
            say(words, node=node_name(one), topic=drive, found=cut(one.topic_type, NAME), type=kind)
            for one in listeners
            if fitting and one not in fitting
        ]
        now_s = time.monotonic()
        if [node_name(one) for one in self._graph.publishers(drive)].count(BRIDGE) < 2:
            self._alone_s = now_s
        if now_s - self._alone_s > GONE_S:
            found.append(
                say("The bridge of another console publishes to {topic}, too: stop it.", topic=drive)
            )
        return found


def _others(endpoints: list[TopicEndpointInfo]) -> list[TopicEndpointInfo]:
    return [one for one in endpoints if not is_own(node_name(one))]


def _connects(kind: str) -> Callable[[TopicEndpointInfo], bool]:
    """Return whether DDS connects a listener with the console's velocities of this type."""
    return lambda one: one.topic_type == kind and not refused(DRIVE, [one])


class Listeners:
    """How many of the robot's nodes listen to a drive topic: the console's own do not move. For one thread."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        # By topic: all listeners, when they were looked at (s), those of the robot
        self._looked: dict[str, tuple[int, float, int]] = {}

    def of(self, topic: str, publisher: Any) -> int:
        """Return the number of the listeners that are connected with a publisher of this topic."""
        count, now_s = int(publisher.get_subscription_count()), time.monotonic()
        before, looked_s, robots = self._looked.get(topic, (-1, -math.inf, 0))
        if now_s - looked_s >= (LOOK_S if count == before else SOON_S):
            own, new = self._own(topic, kind_of(publisher))
            robots = max(count - own, 0)
            self._looked[topic] = -1 if new else count, now_s, robots
        return min(robots, count)

    def _own(self, topic: str, kind: str) -> tuple[int, int]:
        """Return how many may be the console's own, and how many of these are too new to be known."""
        try:
            known, new = self._graph.listeners(topic, _connects(kind))
        except Exception:  # what strangers call their nodes; a zero or a twist must go out all the same
            log.exception("who listens to %s cannot be read", topic)
            return 0, 0
        return new + sum(is_own(node_name(one)) for one in known), new
