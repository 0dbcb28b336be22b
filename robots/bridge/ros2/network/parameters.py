"""The parameters and motions of a robot's nodes. Calls take a while: no call on the event loop."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, ListParameters

from robots.bridge.ros2.participant import Participant
from robots.shared.texts import MOST_MOTIONS

PATIENCE_S = 3.0
GET = "/get_parameters"
MOST = 20 * MOST_MOTIONS  # parameters of one node
FIELDS = {
    ParameterType.PARAMETER_BOOL: "bool_value",
    ParameterType.PARAMETER_INTEGER: "integer_value",
    ParameterType.PARAMETER_DOUBLE: "double_value",
    ParameterType.PARAMETER_STRING: "string_value",
    ParameterType.PARAMETER_BOOL_ARRAY: "bool_array_value",
    ParameterType.PARAMETER_INTEGER_ARRAY: "integer_array_value",
    ParameterType.PARAMETER_DOUBLE_ARRAY: "double_array_value",
    ParameterType.PARAMETER_STRING_ARRAY: "string_array_value",
}


class NodeParameters:
    """Asks the robot's nodes."""

    def __init__(self, participant: Participant) -> None:
        self._participant = participant

    def motions(self, action: str, motion: str = "") -> Any:
        """Return an action's motions as ROS 1 has them: joints, points with positions and times, meta."""
        prefix = f"motions.{motion}".rstrip(".")
        found = self.below(action, prefix)
        if motion:
            return _motion(found) if found else None
        return {name: _motion(one) for name, one in found.items() if isinstance(one, dict)} or None

    def listed_motions(self, _action: str) -> dict[str, float] | None:
        """Return None: play_motion2 lists names without durations; these are in the parameters."""
        return None

    def below(self, node: str, prefix: str) -> dict[str, Any]:
        """Return a node's parameters below a prefix; their names' dots make inner tables. Raises `Unreachable`."""
        listing = ListParameters.Request(prefixes=[prefix] if prefix else [])
        names = self._ask(ListParameters, f"{node}/list_parameters", listing).result.names[:MOST]
        wanted = GetParameters.Request(names=names)
        values = self._ask(GetParameters, f"{node}{GET}", wanted).values if names else []
        table: dict[str, Any] = {}
        for name, value in zip(names, values, strict=False):
            *path, last = name.removeprefix(prefix).strip(".").split(".")
            place = table
            for part in path:
                inner = place.setdefault(part, {})
                place = inner if isinstance(inner, dict) else {}
            place[last] = _plain(value)
        return table

    def has(self, node: str) -> bool:
        """Return whether a node seems to have parameters, without a question."""
        return bool(self._participant.node.count_services(f"{node}{GET}"))

    def value(self, node: str, name: str, patience_s: float) -> Any:
        """Return one parameter; None if the node does not have it. Raises `Unreachable`."""
        wanted = GetParameters.Request(names=[name])
        values = self._ask(GetParameters, f"{node}{GET}", wanted, patience_s).values
        return _plain(values[0]) if values else None

    def _ask(self, kind: Any, service: str, request: Any, patience_s: float = PATIENCE_S) -> Any:
        return self._participant.ask(kind, service, request, patience_s)


def _plain(value: Any) -> Any:
    field = FIELDS.get(value.type)
    found = getattr(value, field) if field else None
    return found if isinstance(found, bool | int | float | str | None) else list(found)


def _motion(table: dict[str, Any]) -> dict[str, Any]:
    """Return the parameters of one motion in the form of ROS 1."""
    joints, positions, times = (
        found if isinstance(found := table.get(name), list) else []
        for name in ("joints", "positions", "times_from_start")
    )
    width = len(joints)
    points = [
        {"positions": positions[at * width : (at + 1) * width], "time_from_start": time}
        for at, time in enumerate(times)
    ]
    return {"joints": joints, "points": points, "meta": table.get("meta", {})}
