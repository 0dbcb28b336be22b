"""Which nodes of a robot publish, listen and serve, as its network tells."""

from __future__ import annotations

from dataclasses import dataclass

from robots.shared.processes.probe_findings import BRIDGE, WATCHDOG

INSPECTOR = "/fleet_inspector"  # prefix of the inspectors' names; each console may have one
CAMERA = "/fleet_camera"  # the same for camera processes
TAP = "/fleet_tap"  # the same for taps
RECORDER = "/fleet_recorder"  # the same for recorders


@dataclass(frozen=True)
class SystemState:
    """Publishers and subscribers: topic -> node names; topic -> type; service -> node names."""

    publishers: dict[str, list[str]]
    subscribers: dict[str, list[str]]
    types: dict[str, str]
    services: dict[str, list[str]]
    is_cut: bool = False  # the robot has more entries than are kept here


def is_own(node: str) -> bool:
    """Return whether a node is a process of a console, not the robot's."""
    return node.startswith((BRIDGE, INSPECTOR, CAMERA, TAP, RECORDER, WATCHDOG))
