"""The robot's motions, by its parameters and services."""

from __future__ import annotations

from typing import Any

from robots.bridge.ros.inspector import services
from robots.bridge.topics.inspector import calls
from robots.bridge.topics.inspector.declined import Declined
from robots.shared.messages.packing import Detail
from robots.shared.ros.master import Master

WHOLE = Detail(whole=10_000, first=10_000, text=1000)  # motions, and characters of a name
LARGEST_LIST = 1024 * 1024  # bytes of the list of motions


class MasterParameters:
    """Asks a robot's master, and the services that it knows."""

    def __init__(self, master: Master) -> None:
        self._master = master

    def motions(self, action: str, motion: str = "") -> Any:
        return self._master.parameter(f"{action}/motions/{motion}".rstrip("/"))

    def listed_motions(self, action: str) -> dict[str, float] | None:
        try:
            found = services.find(self._master, f"{action}/list_motions")
            if found.type != "play_motion_msgs/ListMotions":
                return None
            answer, _ = calls.call(services.exchange, found, {}, lambda: None, WHOLE, LARGEST_LIST)
        except (Declined, ValueError):
            return None
        return {
            info["name"]: info["duration"]["secs"] + info["duration"]["nsecs"] / 1e9
            for info in answer["motions"]
        }
