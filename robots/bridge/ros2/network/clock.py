"""Whether the robot's clock is simulated."""

from __future__ import annotations

import logging

from robots.bridge.ros2.network.graph import Graph, is_valid, node_name
from robots.bridge.ros2.network.parameters import NodeParameters
from robots.shared.unreachable import Unreachable

log = logging.getLogger(__name__)

CLOCK = "/clock"  # published where time is simulated, and by strangers who play recordings
NAME = "use_sim_time"
PATIENCE_S = 0.5  # the survey waits meanwhile
TRIES = 3  # of a node that does not answer: it may be busy


class SimulatedClock:
    """Asks the nodes that publish the robot's odometry. When in doubt the clock is real: then stamps count."""

    def __init__(self, graph: Graph, parameters: NodeParameters, odometry: str) -> None:
        self._graph = graph
        self._parameters = parameters
        self._odometry = odometry
        self._asked = frozenset[bytes]()  # publishers of clock and odometry at the last question
        self._tries = 0
        self._follows = False

    def look(self) -> bool:
        """Return whether the robot follows a simulated clock. Asks once, and again after a change of publishers."""
        clocks, sources = self._graph.publishers(CLOCK), self._graph.publishers(self._odometry)
        nodes = {node_name(one) for one in sources}
        answerable = bool(clocks and nodes) and all(
            is_valid(one) and self._parameters.has(one) for one in nodes
        )
        present = frozenset(bytes(one.endpoint_gid) for one in [*clocks, *sources] if answerable)
        if present != self._asked:
            self._asked, self._follows, self._tries = present, False, TRIES if answerable else 0
        if self._tries:
            self._tries -= 1
            try:
                self._follows = all(self._parameters.value(one, NAME, PATIENCE_S) is True for one in nodes)
                self._tries = 0
            except Unreachable as error:
                log.info("whether the robot's clock is simulated is not known: %s", error)
        return self._follows
