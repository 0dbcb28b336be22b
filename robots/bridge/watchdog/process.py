"""The watchdog process: connects the rules with socket, ROS and clock."""

from __future__ import annotations

import logging
import os
import signal
import socket
import sys
import time
from typing import TYPE_CHECKING

import msgspec

from robots.bridge.robot.sides import stop_side
from robots.bridge.watchdog.rules import CANCEL_AGAIN_S, Heartbeat, StopRules
from robots.bridge.watchdog.socket import ReceivedMessage, WatchdogSocket
from robots.bridge.watchdog.stop_file import StopFile
from robots.shared import wire
from robots.shared.configuration.watchdog_config import WatchdogConfig
from robots.shared.processes.memory import limit_memory
from robots.shared.processes.scheduling import ask_for_priority
from robots.shared.processes.shutdown import exit_within
from robots.shared.sentences import catalogued
from robots.shared.wire import LinkStop, Refusal, Refused, Stopped, StopState

if TYPE_CHECKING:
    from robots.bridge.robot.interface import StopSide

log = logging.getLogger(__name__)

PERIOD_S = 0.05  # s between zeros
IDLE_S = 1.0  # s: without a bridge and without a stop there is no work
LAST_S = 2.0  # s after the life line closed: time for the bridge's own end
END_S = 3.0
MOST_BYTES = 512 * 1024 * 1024  # the process needs a fifth of this

_OTHER = Refusal("other_robot", "This is the watchdog of another robot.", "wire")
_decoder: msgspec.json.Decoder[LinkStop | Heartbeat] = msgspec.json.Decoder(LinkStop | Heartbeat)


class Watchdog:
    """One robot's watchdog; everything here runs on one thread."""

    def __init__(
        self,
        config: WatchdogConfig,
        rules: StopRules,
        stop_file: StopFile,
        lane: WatchdogSocket,
        robot: StopSide,
    ) -> None:
        self._config = config
        self._rules = rules
        self._stop_file = stop_file
        self._lane = lane
        self._robot = robot
        self._bridge: socket.socket | None = None
        self._unanswered: list[tuple[socket.socket, LinkStop]] = []
        self._zero_s = self._cancelled_s = float("-inf")

    def run(self) -> None:
        """Run until the life line closes; then wait for the end of the bridge, which stops the robot."""
        end_s = float("inf")
        while time.monotonic() < end_s and not (self._lane.ended and self._bridge is None):
            now_s = time.monotonic()
            self.step(self._lane.wait(self._pause_s(now_s)), time.monotonic())
            if self._lane.ended:
                end_s = min(end_s, time.monotonic() + LAST_S)

    def step(self, heard: list[ReceivedMessage], now_s: float) -> None:
        """Handle messages, then act: a bridge whose heartbeat is queued is not silent."""
        for connection, message in heard:
            self._handle(connection, message, now_s)
        self._act(now_s)

    def _pause_s(self, now_s: float) -> float:
        if self._bridge is None and not self._rules.zeros(now_s):
            return IDLE_S
        return max(self._zero_s + PERIOD_S - now_s, 0.0) if self._rules.zeros(now_s) else PERIOD_S

    def _handle(self, connection: socket.socket, message: bytes | None, now_s: float) -> None:
        if message is None:
            self._gone(connection, now_s)
            return
        match _understood(message):
            case LinkStop() as said:
                self._stop(connection, said, now_s)
            case Heartbeat() as said:
                self._beat(connection, said, now_s)
            case None:
                self._lane.drop(connection)
                self._gone(connection, now_s)

    def _gone(self, connection: socket.socket, now_s: float) -> None:
        self._unanswered = [entry for entry in self._unanswered if entry[0] is not connection]
        if connection is self._bridge:
            self._bridge = None
            # the bridge's latched stop is in the bridge's state file, and is not stored here again
            self._rules.bridge_gone(now_s)
            log.warning("the bridge ended%s", ": the robot stays stopped" if self._rules.latched else "")

    def _stop(self, connection: socket.socket, stop: LinkStop, now_s: float) -> None:
        if stop.robot is not None and stop.robot != self._config.robot_id:
            self._lane.send(connection, wire.encode(Refused("link_stop", _OTHER, stop.seq)))
            return
        press = self._rules.press(stop.by, stop.reason, stop.press, None if stop.waited else now_s)
        self._zero_s = self._cancelled_s = float("-inf")  # send both at once
        self._unanswered.append((connection, stop))
        if self._bridge is not None:
            self._lane.send(self._bridge, wire.encode(press))
        self._act(now_s)
        self._stop_file.keep(press)

    def _beat(self, connection: socket.socket, beat: Heartbeat, now_s: float) -> None:
        if connection is not self._bridge:
            log.info("a bridge connected")
            self._bridge = connection
            self._rules.bridge_came(now_s)
        news = self._rules.beat(beat, now_s)
        if news is not None:
            self._lane.send(connection, wire.encode(news))
        if self._rules.own is None:
            self._stop_file.keep(None)
        if beat.drive:
            self._robot.drive_to(beat.drive)

    def _act(self, now_s: float) -> None:
        """Send zeros and cancels when due; answer each stop that has reached the robot."""
        if self._rules.zeros(now_s) and now_s - self._zero_s >= PERIOD_S:
            # Keep the pace; missed zeros are not sent later
            self._zero_s = max(self._zero_s + PERIOD_S, now_s - PERIOD_S)
            if self._robot.zero():
                self._rules.reached(now_s)
                self._answer(now_s)
        if self._rules.cancel(now_s) and now_s - self._cancelled_s >= CANCEL_AGAIN_S:
            self._cancelled_s = now_s
            hung = self._rules.hung(now_s)
            if (
                hung is not None and self._bridge is not None
            ):  # first: the bridge must know why before the robot reports
                self._lane.send(self._bridge, wire.encode(hung))
            self._robot.cancel()

    def _answer(self, now_s: float) -> None:
        moves = self._rules.moves_although_stopped(now_s)
        for connection, stop in self._unanswered:
            state = StopState("stopping", stop.by, stop.reason)
            self._lane.send(connection, wire.encode(Stopped(state, stop.seq, stop.press, moves)))
        self._unanswered.clear()


def _understood(message: bytes) -> LinkStop | Heartbeat | None:
    """Decode a message; None: unknown. A damaged stop is still a stop."""
    try:
        return _decoder.decode(message)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        kind, seq = wire.heading(message)
        if kind == "link_stop":
            return LinkStop("somebody", catalogued("the message was damaged"), seq or 0)
        log.warning("a message on the stop socket could not be decoded: %s", error)
        return None


def run(config: WatchdogConfig) -> int:
    """Run the watchdog of one robot; return the exit code."""
    logging.basicConfig(format=f"watchdog of {config.slug}: %(message)s")
    logging.getLogger("robots").setLevel(logging.INFO)
    log.info("starts, Fleet console %s", os.environ.get("FLEET_RELEASE", "of an unknown release"))
    limit_memory(MOST_BYTES)
    sys.setswitchinterval(0.001)  # s: zeros wait less for the ROS side's threads
    stop_file = StopFile(config.state_dir, config.robot_id)
    rules = StopRules(time.time_ns() // 1_000_000, stop_file.load(), stop_file.before())
    stop_file.start()
    lane = WatchdogSocket(config.lane, sys.stdin.fileno())
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: sys.exit(0))
    robot = stop_side(config)
    robot.start()
    ask_for_priority()
    try:
        Watchdog(config, rules, stop_file, lane, robot).run()
    finally:
        exit_within(END_S)
        if rules.zeros(time.monotonic()):
            robot.zero()
        lane.close()
        robot.stop()
    return 0
