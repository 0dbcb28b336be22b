"""/diagnostics, once a second: motors with temperatures, laser, battery, computer; with their faults."""

from __future__ import annotations

import itertools

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from robots.simulator.robot import Robot

COOL_C, WARM_C = 31.0, 22.0  # of a motor at rest, and the increase at full speed
FASTEST_MPS = 1.0
WARMS = 0.01  # share of the difference to its final temperature that a motor gains in a second
HOT_C = 84.0
FLOOD = 300  # parts of one message


class DiagnosticsTopic:
    """The reports of the robot's nodes on its parts."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._topic = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=5)
        self._motor_c = COOL_C
        self._numbers = itertools.count()

    def publish(self, stamp: rospy.Time) -> None:
        """Publish once a second."""
        faults = self._robot.faults
        speed = min(1.0, sum(map(abs, self._robot.physics.velocity)) / FASTEST_MPS)
        self._motor_c += WARMS * (COOL_C + WARM_C * speed - self._motor_c)
        if faults.diagnostics_dead:
            return
        parts = self._parts()
        if faults.diagnostics_garbage:
            parts += _garbage()
        self._send(stamp, parts)

    def flood(self, stamp: rospy.Time) -> None:
        """Publish as often as the simulator ticks, while this fault lasts."""
        if self._robot.faults.diagnostics_flood:
            text = "flood " * 20
            self._send(stamp, [_status(f"flood {next(self._numbers)}", 1, text) for _ in range(FLOOD)])

    def _send(self, stamp: rospy.Time, parts: list[DiagnosticStatus]) -> None:
        message = DiagnosticArray(status=parts)
        message.header.stamp = stamp
        self._topic.publish(message)

    def _parts(self) -> list[DiagnosticStatus]:
        faults, battery = self._robot.faults, self._robot.battery
        left_c = HOT_C if faults.motor_hot else self._motor_c
        laser = (2, "No data from the scanner") if faults.laser_dead else (0, "OK")
        low = battery.percent < 20.0 and not battery.charging
        return [
            _motor("left", left_c),
            _motor("right", self._motor_c),
            _status("Laser: scanner", *laser),
            _status("Battery", int(low), "Low charge" if low else "OK", charge=f"{battery.percent:.1f} %"),
            _status("Computer", 0, "OK", cpu_temperature="52.0"),
            _status("Speakers", *((2, "Amplifier does not answer") if faults.part_broken else (0, "OK"))),
        ]


def _motor(side: str, celsius: float) -> DiagnosticStatus:
    hot = celsius > 80.0
    return _status(
        f"Motors: {side} wheel", int(hot), "Too warm" if hot else "OK", Temperature=f"{celsius:.1f}"
    )


def _status(name: str, level: int, text: str, **values: str) -> DiagnosticStatus:
    pairs = [KeyValue(key, value) for key, value in values.items()]
    return DiagnosticStatus(name=name, level=level, message=text, hardware_id="simulator", values=pairs)


def _garbage() -> list[DiagnosticStatus]:
    garbage = [
        _status("No such level", 7, "level 7"),
        _status("", 2, "no name"),
        _status("///", 2, "no name"),
        _status("Furnace", 0, "OK", temperature="nan", temp="1e30", Temperature="hot"),
        _status("Long " * 1000, 1, "long " * 2000),
    ]
    for status in garbage:
        status.hardware_id = ""  # it would stand for a missing name
    return garbage
