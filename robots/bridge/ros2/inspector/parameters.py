"""Parameters of the robot's nodes, by names such as /play_motion2:motions.wave.joints.

A name without a colon is a node: the tree of all its parameters. "/" is the tree of all nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from robots.bridge.ros2.inspector.graph import names_of
from robots.bridge.ros2.network.parameters import NodeParameters
from robots.bridge.ros2.participant import Participant
from robots.bridge.topics.inspector.declined import Declined
from robots.shared.messages.fields import BadField
from robots.shared.sentences import say
from robots.shared.unreachable import Unreachable

ALL_S = 1.5  # until all nodes must have told their parameters
MOST_ASKED = 16  # nodes at once
LISTED, SET = "/list_parameters", "/set_parameters"


class Parameters:
    """Asks nodes, and sets one parameter at a time."""

    def __init__(self, participant: Participant) -> None:
        self._participant = participant
        self._nodes = NodeParameters(participant)

    def names(self) -> list[str]:
        """Return the names of all parameters; nodes that do not answer in time are missing."""
        return [f"{node}:{name}" for node, table in self.everything().items() for name in _leaves(table)]

    def everything(self) -> dict[str, dict[str, Any]]:
        """Return the parameters of all nodes that answer in time."""
        graph = self._participant.node.get_service_names_and_types()
        served = {name.removesuffix(LISTED) for name, _ in graph if name.endswith(LISTED)}
        asking = ThreadPoolExecutor(MOST_ASKED)
        nodes = [node for node in names_of(self._participant.node) if node in served]
        waiting = {asking.submit(self._nodes.below, node, ""): node for node in nodes}
        answered, _ = wait(waiting, ALL_S)
        asking.shutdown(wait=False, cancel_futures=True)
        found = {waiting[one]: one.result() for one in answered if one.exception() is None}
        return dict(sorted(found.items()))

    def value(self, name: str) -> Any:
        """Return a value, or the tree below a name; None if there is none. Raises Unreachable."""
        if name == "/":
            return self.everything()
        node, _, path = name.partition(":")
        if node not in names_of(self._participant.node):
            return None
        *before, last = path.split(".")
        table = self._nodes.below(node, ".".join(before))
        return table.get(last) if path else table

    def set(self, name: str, value: Any, require_time: Callable[[], None]) -> None:
        """Set one parameter of a node. Raises BadField, Declined or Unreachable."""
        node, colon, path = name.partition(":")
        if not colon or not path:
            raise BadField(name, "{path}: name one parameter, such as /node:parameter.")
        present = self.value(name)
        if isinstance(present, float) and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        try:
            parameter = Parameter(path, value=value).to_parameter_msg()
        except (TypeError, ValueError, AssertionError) as error:
            raise BadField(
                name, "{path}: a parameter is a text, a number, true or false, or a list of one of these."
            ) from error
        self._send(node, parameter, require_time)

    def delete(self, name: str, require_time: Callable[[], None]) -> None:
        """Take a parameter's value away, if its node allows that. Raises Declined or Unreachable."""
        node, _, path = name.partition(":")
        parameter = Parameter(path).to_parameter_msg()
        parameter.value.type = ParameterType.PARAMETER_NOT_SET
        self._send(node, parameter, require_time)

    def _send(self, node: str, parameter: Any, require_time: Callable[[], None]) -> None:
        request = SetParameters.Request(parameters=[parameter])
        try:
            found = self._participant.ask(SetParameters, f"{node}{SET}", request, ALL_S, require_time)
            (result,) = found.results
        except ValueError as error:
            raise Unreachable(say("{service} does not answer", service=f"{node}{SET}")) from error
        if not result.successful:
            text = say("{service} reported a failure: {reason}", service=node, reason=result.reason[:300])
            raise Declined("service_failed", text, service=node)


def _leaves(table: dict[str, Any], before: str = "") -> list[str]:
    found = []
    for name, value in table.items():
        found += _leaves(value, f"{before}{name}.") if isinstance(value, dict) else [f"{before}{name}"]
    return found
