"""The registry: profiles, robots, roles, phrases, allow-lists, and the state of bridges."""

from robots.registry.models.bridges import BridgeHost, BridgePulse, BridgeStatus, RobotDescription, RobotMap
from robots.registry.models.entries import (
    Allowance,
    OfProfileOrRobot,
    Phrase,
    check_phrase_language,
    check_phrase_text,
)
from robots.registry.models.registry import (
    ReverseSteering,
    Robot,
    RobotProfile,
    RobotRole,
    Role,
    RosChoice,
    default_stick,
)

__all__ = [
    "Allowance",
    "BridgeHost",
    "BridgePulse",
    "BridgeStatus",
    "OfProfileOrRobot",
    "Phrase",
    "ReverseSteering",
    "Robot",
    "RobotDescription",
    "RobotMap",
    "RobotProfile",
    "RobotRole",
    "Role",
    "RosChoice",
    "check_phrase_language",
    "check_phrase_text",
    "default_stick",
]
