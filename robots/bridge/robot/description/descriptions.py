"""When a robot's description is read, and what gets it: the arm's posture and the console's records."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from robots.bridge.arm.posture import ArmPosture
from robots.bridge.audit.description import taken_description
from robots.bridge.robot.incoming.reception import Reception
from robots.shared.configuration.bridge_config import Topics
from robots.shared.graph import SystemState
from robots.shared.unreachable import Unreachable

DESCRIBED_S = 60.0  # between two reads of the description while nobody has control
RESTARTED_S = 5.0  # between two reads, if nodes come and go; `DESCRIBED_S` after `FRUITLESS` reads
FRUITLESS = 3  # reads in a row, while somebody has control, that find no new description
LARGE = 1_000_000  # characters: reading so large a description may delay the control loop


class Descriptions:
    """Reads the description by `ask`, which returns None if the robot has none, and raises Unreachable."""

    def __init__(
        self,
        topics: Topics,
        ask: Callable[[], object],
        posture: ArmPosture | None,
        reception: Reception,
        tf: str = "/tf",
    ) -> None:
        joints = [topics.joint_states.name] if topics.joint_states else []
        self._topics = {tf, topics.odometry.name, *joints}
        self._ask = ask
        self._posture = posture
        self._reception = reception
        self._described = False
        self._description: object = None  # the robot's description that is in use
        self._read_s = -math.inf  # time of the last read
        self._fruitless = 0  # reads in a row, while somebody has control, that found nothing new
        self._publishers_at_last_read: set[str] = set()  # nodes that published joints, tf and odometry

    def restarted(self) -> None:
        """Forget the description of a robot that started again, and read its present one."""
        self._described, self._description = False, None
        if self._posture:
            self._posture.awaits_description = True
        self.read()

    def surveyed(self, system: SystemState) -> None:
        """Read the description, if that is due."""
        self._look_for_restart(system)
        self.read()

    def _look_for_restart(self, system: SystemState) -> None:
        """Let the description be read again when nodes came or went that a restart of the robot replaces.

        The read every `DESCRIBED_S`, while nobody has control, finds other changes: a restart between two
        surveys, or a new description without a restart.
        """
        publishers = {node for name in self._topics for node in system.publishers.get(name, [])}
        seconds = time.monotonic() - self._read_s
        is_due = seconds >= DESCRIBED_S and not self._reception.core.in_use
        gap_s = RESTARTED_S if self._fruitless < FRUITLESS else DESCRIBED_S
        if is_due or (publishers != self._publishers_at_last_read and seconds >= gap_s):
            self._described, self._publishers_at_last_read = False, publishers

    def read(self) -> None:
        """Pass the robot's description to the arm's posture and to the console as soon as the robot has one.

        A known description is used until the robot has another. A large new one waits until nobody has
        control.
        """
        if self._described:
            return
        try:
            description = self._ask()
            if self._posture:
                self._posture.awaits_description = False
        except Unreachable:
            description = None  # the next survey asks again, unless one is known and somebody drives
        core = self._reception.core
        known, drives = self._description is not None, core.in_use
        self._read_s, self._described = time.monotonic(), description is not None or (known and drives)
        waits = description is None or (drives and isinstance(description, str) and len(description) > LARGE)
        if description == self._description or (known and waits):
            self._fruitless = self._fruitless + 1 if drives else 0
            return
        self._description, self._fruitless = description, 0
        if self._posture:
            self._posture.describe(description)
        if self._described:
            taken = taken_description(description)
            self._reception.post(lambda: core.described(taken, self._ask_again))

    def _ask_again(self) -> None:
        """Let the next survey read the description again: the console could not keep it."""
        self._described, self._description = False, None
