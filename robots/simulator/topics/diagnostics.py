"""/diagnostics, once a second: motors with temperatures, laser, battery, computer; with their faults."""

from __future__ import annotations

import itertools
from typing import Any

from robots.simulator.robot import Robot
from robots.simulator.ros_side import RosSide, Stamp

COOL_C, WARM_C = 31.0, 22.0  # of a motor at rest, and the increase at full speed
FASTEST_MPS = 1.0
WARMS = 0.01  # share of the difference to its final temperature that a motor gains in a second
HOT_C = 84.0
FLOOD = 300  # parts of one message


class DiagnosticsTopic:
    """The reports of the robot's nodes on its parts."""

    def __init__(self, ros: RosSide, robot: Robot) -> None:
        self._ros = ros
        self._robot = robot
        self._topic = ros.publisher("/diagnostics", "diagnostic_msgs/DiagnosticArray", queue=5)
        self._motor_c = COOL_C
        self._numbers = itertools.count()

    def publish(self, stamp: Stamp) -> None:
        """Publish once a second."""
        faults = self._robot.faults
        speed = min(1.0, sum(map(abs, self._robot.physics.velocity)) / FASTEST_MPS)
        self._motor_c += WARMS * (COOL_C + WARM_C * speed - self._motor_c)
        if faults.diagnostics_dead:
            return
        parts = self._parts()
        if faults.diagnostics_garbage:
            parts += self._garbage()
        self._send(stamp, parts)

    def flood(self, stamp: Stamp) -> None:
        """Publish as often as the simulator ticks, while this fault lasts."""
        if self._robot.faults.diagnostics_flood:
            text = "flood " * 20
            self._send(stamp, [self._status(f"flood {next(self._numbers)}", 1, text) for _ in range(FLOOD)])

    def _send(self, stamp: Stamp, parts: list[Any]) -> None:
        message = self._ros.new("diagnostic_msgs/DiagnosticArray", status=parts)
        self._topic.publish(self._ros.stamped(message, stamp))

    def _parts(self) -> list[Any]:
        faults, battery = self._robot.faults, self._robot.battery
        left_c = HOT_C if faults.motor_hot else self._motor_c
        laser = (2, "No data from the scanner") if faults.laser_dead else (0, "OK")
        low = battery.percent < 20.0 and not battery.charging
        return [
            self._motor("left", left_c),
            self._motor("right", self._motor_c),
            self._status("Laser: scanner", *laser),
            self._status(
                "Battery", int(low), "Low charge" if low else "OK", charge=f"{battery.percent:.1f} %"
            ),
            self._status("Computer", 0, "OK", cpu_temperature="52.0"),
            self._status(
                "Speakers", *((2, "Amplifier does not answer") if faults.part_broken else (0, "OK"))
            ),
        ]

    def _motor(self, side: str, celsius: float) -> Any:
        hot = celsius > 80.0
        return self._status(
            f"Motors: {side} wheel", int(hot), "Too warm" if hot else "OK", Temperature=f"{celsius:.1f}"
        )

    def _status(self, name: str, level: int, text: str, **values: str) -> Any:
        pairs = [
            self._ros.new("diagnostic_msgs/KeyValue", key=key, value=value) for key, value in values.items()
        ]
        return self._ros.new(
            "diagnostic_msgs/DiagnosticStatus",
            name=name,
            level=self._ros.octet(level),
            message=text,
            hardware_id="simulator",
            values=pairs,
        )

    def _garbage(self) -> list[Any]:
        garbage = [
            self._status("No such level", 7, "level 7"),
            self._status("", 2, "no name"),
            self._status("///", 2, "no name"),
            self._status("Furnace", 0, "OK", temperature="nan", temp="1e30", Temperature="hot"),
            self._status("Long " * 1000, 1, "long " * 2000),
        ]
        for status in garbage:
            status.hardware_id = ""  # it would stand for a missing name
        return garbage
