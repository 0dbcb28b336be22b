"""The inspector's part that asks a ROS master and its nodes."""

from __future__ import annotations

import logging
import xmlrpc.client
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from robots.bridge.ros.inspector import graph, services
from robots.bridge.ros.inspector.definitions import Definitions, sums
from robots.bridge.ros.network.tcpros import Conversation, Header, first_response
from robots.bridge.topics.inspector.side import Node, Service
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.denylist import COUNTERFEITED
from robots.shared.configuration.robot_ros import ros1
from robots.shared.graph import INSPECTOR
from robots.shared.messages.definition import Definition
from robots.shared.messages.fields import BadField
from robots.shared.ros.master import Master, MasterError
from robots.shared.ros.message_types.classes import message_class
from robots.shared.sentences import say

log = logging.getLogger(__name__)


class Ros1:
    """`robots.bridge.topics.inspector.side.InspectorSide`."""

    def __init__(self, config: BridgeConfig) -> None:
        self._config = config
        self._master = Master(ros1(config.ros).master_uri, INSPECTOR)
        self._definitions = Definitions(Path(config.state_dir) / "definitions")

    def join(self) -> Node:
        """Register the node. Raises MasterError."""
        from robots.bridge.ros.inspector.node import joined  # here, because most queries need no node

        try:
            return joined(self._config, self._master, self._definitions)
        except OSError as error:
            text = say("No ROS master answers at {master}.", master=self._master.uri)
            raise MasterError(text) from error

    # --- topics ----------------------------------------------------------------------------------------

    def graph(self, seq: int) -> wire.Graph:
        """Return what the master lists."""
        return graph.graph(self._master, seq)

    def definition(self, type_name: str, topic: str | None = None) -> Definition:
        """Return the definition of a publisher of this type on the topic, else the known definition."""
        header = self._connection_header(topic) if topic else {}
        if header.get("type") == type_name:
            return self._definitions.of_connection(header)
        return self._definitions.of_type(type_name)

    def _connection_header(self, topic: str) -> Header:
        """Return the connection header of the first publisher that can be reached; empty if there is none."""
        nodes = self._master.system_state().publishers.get(topic, [])
        addresses = {node: self._master.node_uri(node) for node in nodes if not node.startswith(INSPECTOR)}
        header, unheard = first_response(Conversation.read_header, topic, addresses, INSPECTOR)
        for node, why in unheard.items():
            log.info("%s does not describe %s: %s", node, topic, why)
        return header or {}

    def imitated(self, definition: Definition) -> str | None:
        """Return the type of a twist that has one of the definition's md5 sums."""
        within = sums(definition)
        return next((name for name in COUNTERFEITED if message_class(name)._md5sum in within), None)

    def texts(self) -> dict[str, str]:
        """Return the texts of the definitions of all topics' types."""
        types = set(self._master.system_state().types.values())
        return {one: self._definitions.text_of(one) for one in sorted(types)}

    # --- services --------------------------------------------------------------------------------------

    def service(self, name: str) -> Service:
        """Ask a service for its type."""
        return services.find(self._master, name)

    def service_part(self, type_name: str, response: bool) -> Definition:
        """Return the definition of an installed service type's request or response."""
        return services.described(type_name, response)

    def service_types(self, names: Iterable[str]) -> dict[str, str]:
        """Ask these services, or all, for their types."""
        return services.types_of(self._master, names or self._master.system_state().services)

    def service_host(self, name: str) -> str:
        """Return the host in a service's address."""
        return services.host_of(self._master, name)

    def call(self, service: Service, request: bytes, require_time: Callable[[], None], largest: int) -> bytes:
        """Call a service by a connection of its own."""
        return services.exchange(service, request, require_time, largest)

    # --- parameters ------------------------------------------------------------------------------------

    def parameter_names(self) -> list[str]:
        """Return the names of all parameters."""
        return [str(name) for name in self._master.call("getParamNames")]

    def has_parameter(self, name: str) -> bool:
        """Return whether the master has a parameter or a tree of this name."""
        return bool(self._master.call("hasParam", name))

    def parameter(self, name: str) -> Any:
        """Return a value, or the tree below `name`."""
        return self._master.parameter(name)

    def set_parameter(self, name: str, value: Any, require_time: Callable[[], None]) -> None:
        """Set a parameter; XML-RPC must be able to carry its value."""
        try:
            xmlrpc.client.dumps((value,))
        except (TypeError, OverflowError) as error:
            raise BadField(
                name, "{path}: a parameter is a text, a number, true or false, or made of these."
            ) from error
        require_time()
        self._master.call("setParam", name, value)

    def delete_parameter(self, name: str, require_time: Callable[[], None]) -> None:
        """Delete a parameter, or the tree below it."""
        require_time()
        self._master.call("deleteParam", name)
