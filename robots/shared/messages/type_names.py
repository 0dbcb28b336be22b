"""Names of ROS types: ROS 1 says geometry_msgs/Twist, ROS 2 geometry_msgs/msg/Twist. Code compares them bare."""

from __future__ import annotations


def bare(type_name: str) -> str:
    """Return a type's package and name, such as geometry_msgs/Twist."""
    package, slash, rest = type_name.partition("/")
    return f"{package}{slash}{rest.rpartition('/')[2]}"


def is_ros2(type_name: str) -> bool:
    """Return whether the name is written as ROS 2 writes it."""
    return type_name.count("/") == 2


def is_action(type_name: str) -> bool:
    """Return whether the type is that of an action."""
    return type_name.endswith("Action") or "/action/" in type_name


def in_ros2(type_name: str) -> str:
    """Return ROS 2's name of a message type of ROS 1."""
    package, _, name = type_name.rpartition("/")
    return type_name if "/" in package else f"{package}/msg/{name}"
