"""A robot's messages on their way to the core: a side's threads have read them, the event loop takes them."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any

from robots.bridge.core import Core
from robots.bridge.gate.arm.discs import Posture
from robots.bridge.gate.obstacles.depth_camera import Frame
from robots.bridge.gate.values import LaserScan
from robots.bridge.health.battery_charge import BatteryCharge
from robots.bridge.health.diagnostics import Status
from robots.bridge.robot.incoming.mailboxes import Mailboxes, Speaker
from robots.bridge.robot.incoming.standing import Standing
from robots.shared.configuration.bridge_config import Topics
from robots.shared.geometry.poses import Pose, Velocity

log = logging.getLogger(__name__)

SCANS_WAIT = 3  # of each laser, if they can wait
ODOMETRY_WAITS = 20  # messages in the queue: the gate pairs scans with all of them
DIAGNOSTICS_WAIT = 20  # some nodes send one message for each part
RESTS = 0.005  # m/s or rad/s: a slower robot stands

Call = Callable[[], None]


class Reception:
    """Passes data to `core` through `mail`. Until `start`, nothing may be received."""

    def __init__(self, topics: Topics, speaker: Callable[[], Speaker | None] = lambda: None) -> None:
        self._sonars = {sonar.frame_id for sonar in topics.sonars}
        self._charge = BatteryCharge()
        self.moves = True  # by the last odometry
        self.watched = False  # somebody looks at views
        # Each takes, on the loop, what a sensor keeps undecoded during a rest
        self.undecoded: list[Call] = []
        self._standing = Standing()
        self.mail = Mailboxes(self.post, lambda: self.core.needs_fresh_sensors, speaker)
        self.core: Core
        self._loop: asyncio.AbstractEventLoop
        self._run_on_loop: Callable[[Call], None]

    def start(self, loop: asyncio.AbstractEventLoop, core: Core, run_on_loop: Callable[[Call], None]) -> None:
        """Name the receivers: `run_on_loop` runs calls with the robot's data on the loop."""
        self._loop, self.core, self._run_on_loop = loop, core, run_on_loop

    def post(self, call: Call) -> None:
        """Run a call on the event loop."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._run_on_loop, call)

    def take_odometry(self) -> None:
        """Handle odometry that has arrived and waits for the event loop, on the loop."""
        try:
            self.mail.take("odometry")
        except Exception:  # the decision that needs it must be made
            log.exception("odometry could not be handled")

    def take_waiting(self) -> None:
        """Handle all that waits for the event loop, on the loop; also what is not decoded yet."""
        for take in (self.mail.take_waiting, *self.undecoded):
            try:
                take()
            except Exception:  # the decision that needs it must be made
                log.exception("messages of sensors could not be handled")

    # --- on the threads of the side ------------------------------------------------------------------

    def restarting(self) -> None:
        """Let the core forget where the robot is: a robot that stands tells its new pose only once."""
        self.post(lambda: self.core.restarting(time.monotonic()))

    def restarted(self) -> None:
        """Report that the robot may have started again."""
        self.post(lambda: self.core.restarted(time.monotonic()))

    def follow_clock(self, simulated: bool) -> None:
        """Report whether the robot's nodes follow a simulated clock."""
        self.post(lambda: self.core.follow_clock(simulated=simulated))

    def odometry(self, stamp_s: float, pose: Pose, velocity: Velocity, run: int, messages: int = 1) -> None:
        """Take odometry of this run of the robot. It stands for so many messages, of which it is the newest."""
        arrival_s, wall_s = time.monotonic(), time.time()
        self.moves = not all(abs(part) < RESTS for part in velocity)
        number = self._standing.next()

        def take() -> None:
            if self._standing.is_shown_by_newest(number):
                self.core.odometry_alike(stamp_s, arrival_s)
            else:
                self._standing.taken(stamp_s)
                self.core.odometry(stamp_s, arrival_s, pose, velocity, wall_s, run, messages)

        self.mail.post("odometry", take, ODOMETRY_WAITS, can_wait=True)
        self._standing.waits(stamp_s, run, rests=self.core.rests and not self.moves)

    def scan(self, scan: LaserScan) -> None:
        rests = self.core.rests
        waits = rests or not (self.watched or self.core.in_use)
        thins = waits and not (rests or self.moves)
        self.mail.post(
            scan.source,
            lambda: self.core.laser(scan, thins=thins),
            SCANS_WAIT if waits else 1,
            can_wait=waits,
        )

    def range(self, frame_id: str, stamp_s: float, range_m: float) -> None:
        """Take a reading; only those of the profile's sonars count."""
        arrival_s, frame_id = time.monotonic(), frame_id.lstrip("/")
        if frame_id in self._sonars:
            self.mail.post(
                ("sonar", frame_id),
                lambda: self.core.range(frame_id, stamp_s, arrival_s, range_m),
                can_wait=True,
            )

    def depth(self, frame: Frame, stamp_s: float, arrival_s: float) -> None:
        self.mail.post("depth", lambda: self.core.depth(frame, stamp_s, arrival_s), can_wait=True)

    def bad_depth(self, why: str) -> None:
        """Take the reason why a picture cannot be used."""
        self.mail.post("bad depth", lambda: self.core.bad_depth(why), can_wait=True)

    def posture(self, arm: Posture, arrival_s: float) -> None:
        self.mail.post("posture", lambda: self.core.posture(arm, arrival_s), can_wait=True)

    def battery(self, message: Any) -> None:
        """Take a message as `BatteryCharge` reads it."""
        percent, arrival_s = self._charge.percent(message), time.monotonic()
        if percent is not None:
            self.mail.post("battery", lambda: self.core.reports.battery(percent, arrival_s), can_wait=True)

    def charging(self, charges: bool) -> None:
        self.mail.post("charging", lambda: self.core.reports.charger(charges), can_wait=True)

    def diagnostics(self, statuses: list[Status]) -> None:
        arrival_s = time.monotonic()
        self.mail.post(
            "diagnostics",
            lambda: self.core.reports.diagnostics.observe(statuses, arrival_s),
            DIAGNOSTICS_WAIT,
            can_wait=True,
        )
