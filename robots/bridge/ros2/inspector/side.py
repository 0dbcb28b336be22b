"""The inspector's part that asks the nodes of a domain."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Any

from robots.bridge.ros2.inspector import graph, services
from robots.bridge.ros2.inspector.node import Node, known
from robots.bridge.ros2.inspector.parameters import Parameters
from robots.bridge.ros2.network.survey import find_robot
from robots.bridge.ros2.participant import Participant
from robots.bridge.topics.inspector import declined
from robots.bridge.topics.inspector.declined import Declined
from robots.bridge.topics.inspector.side import Service
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import ros2
from robots.shared.graph import INSPECTOR
from robots.shared.messages.definition import Definition


class Ros2:
    """`robots.bridge.topics.inspector.side.InspectorSide`."""

    def __init__(self, config: BridgeConfig) -> None:
        self._participant = Participant(f"{INSPECTOR.strip('/')}_{os.getpid()}", ros2(config.ros).domain_id)
        self._participant.start()
        self._node = self._participant.node
        self._parameters = Parameters(self._participant)
        find_robot(self._participant, config.topics)

    def join(self) -> Node:
        """Return the node, which is there already."""
        return Node(self._participant)

    # --- topics ----------------------------------------------------------------------------------------

    def graph(self, seq: int) -> wire.Graph:
        """Return what the domain's nodes tell of themselves."""
        return graph.graph(self._node, seq)

    def definition(self, type_name: str, topic: str | None = None) -> Definition:
        """Return the installed definition: publishers of ROS 2 send none."""
        return known(type_name)

    def imitated(self, definition: Definition) -> str | None:
        """Return None: DDS does not connect a type to one of another name."""

    def texts(self) -> dict[str, str]:
        """Return the texts of the definitions of all topics' types."""
        kinds = {kind for _, listed in self._node.get_topic_names_and_types() for kind in listed}
        return {kind: _text(kind) for kind in sorted(kinds)}

    # --- services --------------------------------------------------------------------------------------

    def service(self, name: str) -> Service:
        """Return a service with its type, as its node tells."""
        type_name = graph.services(self._node).get(name)
        if type_name is None:
            raise declined.no_service(name)
        request, response = (services.described(type_name, part) for part in (False, True))
        return Service(name, type_name, request, response)

    def service_part(self, type_name: str, response: bool) -> Definition:
        """Return the definition of an installed service type's request or response."""
        return services.described(type_name, response)

    def service_types(self, names: Iterable[str]) -> dict[str, str]:
        """Return the types of these services, or of all."""
        found = graph.services(self._node)
        return {name: found[name] for name in names or found if name in found}

    def service_host(self, name: str) -> str:
        """Return the node: DDS does not tell on which computer it runs."""
        return next((row.node for row in self.graph(0).services if row.name == name), "")

    def call(self, service: Service, request: bytes, require_time: Callable[[], None], largest: int) -> bytes:
        """Call a service by a client of its own."""
        return services.exchange(self._participant, service, request, require_time, largest)

    # --- parameters ------------------------------------------------------------------------------------

    def parameter_names(self) -> list[str]:
        """Return names such as /node:parameter."""
        return self._parameters.names()

    def has_parameter(self, name: str) -> bool:
        """Return whether a node has this parameter, or parameters below this name."""
        return self._parameters.value(name) is not None

    def parameter(self, name: str) -> Any:
        """Return a value, or the tree below `name`."""
        return self._parameters.value(name)

    def set_parameter(self, name: str, value: Any, require_time: Callable[[], None]) -> None:
        """Set one parameter of a node."""
        self._parameters.set(name, value, require_time)

    def delete_parameter(self, name: str, require_time: Callable[[], None]) -> None:
        """Take a parameter's value away."""
        self._parameters.delete(name, require_time)


def _text(type_name: str) -> str:
    try:
        return known(type_name).text
    except Declined:
        return ""
