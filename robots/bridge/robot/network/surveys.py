"""The bridge's conclusions from the publishers and listeners of a robot, as its side finds them every few seconds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from msgspec import structs

from robots.bridge.robot.board import BOARD
from robots.bridge.robot.incoming.reception import Reception
from robots.bridge.robot.network.velocity_sources import velocity_sources
from robots.bridge.robot_reports import RosStatus
from robots.shared.configuration.bridge_config import BridgeConfig, Topic
from robots.shared.graph import SystemState, is_own
from robots.shared.messages.type_names import bare
from robots.shared.processes.probe_findings import BRIDGE, watchdog_name
from robots.shared.sentences import say
from robots.shared.texts import SENTENCE, cut, named

MOST_PROBLEMS = 10  # in one report
MOST_LOOKED_UP = 8  # nodes whose address one survey asks for


class Surveys:
    """Reports the surveys of one robot. `ask` surveys it now; `run_of` tells one run of a node from its next."""

    def __init__(
        self,
        config: BridgeConfig,
        reception: Reception,
        ask: Callable[[], SystemState],
        run_of: Callable[[str], object],
    ) -> None:
        self._config = config
        self._reception = reception
        self._ask = ask
        self._run_of = run_of
        self._listened: dict[str, str] = {}  # topics with listeners at the last survey, and their types
        self._map_servers: dict[str, object] = {}  # nodes that publish the map, with their runs

    def restarted(self) -> None:
        """Forget the nodes of a robot that started again."""
        self._map_servers = {}

    def report(self, status: RosStatus) -> None:
        """Report the state of the connection to the robot."""
        short = structs.replace(status, text=cut(status.text, SENTENCE))
        self._reception.post(lambda: self._reception.core.ros_status(short, time.monotonic()))

    def surveyed(self, system: SystemState, drive: str, problems: Iterable[str]) -> None:
        """Report the robot's state: velocities go to the topic `drive`; what the side has found comes last."""
        self.report(self._status(system, drive, problems))
        self._report_listened(system)
        self._look_for_map_server(system)

    def find_listener(self, topic: str) -> None:
        """Ask the robot again who listens, if nobody listened to this topic at the last survey."""
        if topic not in self._listened:
            self._report_listened(self._ask())

    def _status(self, system: SystemState, drive: str, found: Iterable[str]) -> RosStatus:
        topics = self._config.topics
        own = {BRIDGE, watchdog_name(self._config.robot_id)}
        foreign = named(sorted(set(system.publishers.get(drive, [])) - own))
        wanted = [structs.replace(topics.drive, name=drive), topics.odometry]
        wanted += [Topic(scan.topic, "sensor_msgs/LaserScan") for scan in topics.scans]
        problems = BOARD.texts()
        if system.is_cut:
            problems.append(
                say("The robot has too many topics or services: the console does not know all of them.")
            )
        problems += [_wrong_type(topic, system.types) for topic in wanted]
        problems += found
        texts = [cut(problem, SENTENCE) for problem in problems if problem]
        velocities = velocity_sources(system, drive, topics.odometry.name)
        return RosStatus("connecting", "", foreign, texts[:MOST_PROBLEMS], velocities)

    def _report_listened(self, system: SystemState) -> None:
        self._listened = listened = _listened(system)
        core = self._reception.core
        self._reception.post(lambda: core.tasks.routing.surveyed(listened, time.monotonic()))

    def _look_for_map_server(self, system: SystemState) -> None:
        """Notice that other nodes, or another run of one, publish the map. If all are gone, the map stays."""
        topic = self._config.topics.map
        nodes = system.publishers.get(topic.name, [])[:MOST_LOOKED_UP] if topic else []
        servers = {node: self._run_of(node) for node in nodes}
        if servers and servers != self._map_servers:
            is_other, self._map_servers = bool(self._map_servers), servers
            if is_other:
                core = self._reception.core
                self._reception.post(
                    lambda: core.tasks.navigation.map_doubted(time.monotonic(), restarted=False)
                )


def _listened(system: SystemState) -> dict[str, str]:
    """Return the topics with listeners apart from the console, and their types."""
    return {
        topic: system.types[topic]
        for topic, nodes in system.subscribers.items()
        if topic in system.types and not all(map(is_own, nodes))
    }


def _wrong_type(topic: Topic, types: dict[str, str]) -> str:
    found = types.get(topic.name)
    kinds = {bare(one.type) for one in (topic, *topic.others)}
    if found is None or found == "*" or bare(found) in kinds:
        return ""
    key = "{topic} is {found} on the robot, {type} in the registry."
    return say(key, topic=topic.name, found=found, type=topic.type)
