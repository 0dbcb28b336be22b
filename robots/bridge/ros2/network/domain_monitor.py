"""Watches the robot's domain on a thread of its own: joins it, keeps the robot from other bridges, surveys it."""

from __future__ import annotations

import logging
import threading
import time
from typing import Protocol

from robots.bridge.robot_reports import RosStatus
from robots.bridge.ros2.message_types import TypeUnknown
from robots.shared.sentences import reason_of, say

log = logging.getLogger(__name__)

STEP_S = 0.5
SURVEY_S = 2.0
NEWS_S = 0.2  # between surveys, while nodes come and go


class Node(Protocol):
    """Callbacks of the monitor, called on its thread."""

    def join(self) -> None:
        """Join the domain, without a word on the drive topic. Called once."""

    def other_bridge(self) -> str | None:
        """Say that this bridge is there; return the host of another one that has the robot."""

    @property
    def holds(self) -> bool:
        """Return whether this bridge has the robot."""

    def hold(self) -> None:
        """Connect to the drive topic: the robot is this bridge's. Called once."""

    @property
    def cut_off(self) -> bool:
        """Return whether the robot can only be found by a process that joins now."""

    def survey(self) -> None:
        """Look who is in the domain."""

    def report(self, status: RosStatus) -> None:
        """Take the reason why the robot is not joined."""

    def lost(self, name_taken: bool) -> None:
        """Handle the loss of the robot: another bridge has it, or `join` or `hold` failed. A new process follows."""


class DomainMonitor:
    """The thread. It survives whatever the domain contains."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._held = False
        self._surveyed_s = float("-inf")
        self._news = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._watch, name="domain", daemon=True)

    def start(self) -> None:
        """Join the domain, and watch it."""
        self._thread.start()

    def look(self) -> None:
        """Survey soon: something has changed."""
        self._surveyed_s = float("-inf")
        self._news.set()

    def close(self) -> None:
        """Stop monitoring. Returns at once."""
        self._ending = True
        self._news.set()

    def _watch(self) -> None:
        try:
            self._node.join()
        except Exception as error:  # noqa: BLE001  (rclpy's own have no common class)
            self._cannot_join(error)
            return
        while not self._ending:
            try:
                if not self._step():
                    return
            except Exception as error:  # without this thread no one would notice the robot's loss
                if self._ending:
                    return
                log.exception("watching the robot's domain failed")
                text = say("Watching the robot’s ROS domain failed ({error}).", error=error)
                self._node.report(RosStatus("waiting", text))
            self._news.wait(STEP_S)
            self._news.clear()
            time.sleep(NEWS_S)

    def _step(self) -> bool:
        """Do what is due. Return false if the robot is lost."""
        host = self._node.other_bridge()
        if host is not None:
            text = say(
                "Another console’s bridge on {host} drives this robot; stop that one first.", host=host
            )
            if self._held:
                self._lose(text, name_taken=True)
                return False
            self._node.report(RosStatus("refused", text))
            return True
        if self._node.holds and not self._held:
            try:
                self._node.hold()
            except Exception as error:  # noqa: BLE001  (rclpy's own have no common class)
                self._cannot_join(error)
                return False
            self._held = True
        if self._node.cut_off:
            text = say("This computer has joined another network: the bridge starts again.")
            self._lose(text, name_taken=False)
            return False
        if time.monotonic() - self._surveyed_s >= SURVEY_S:
            self._surveyed_s = time.monotonic()
            self._node.survey()
        return True

    def _cannot_join(self, error: Exception) -> None:
        """Give up: nobody may drive half a robot."""
        log.error("joining the robot's domain failed", exc_info=error)
        if isinstance(error, TypeUnknown):
            text = reason_of(error)
        else:
            text = say("The bridge could not join the robot ({error}).", error=error)
        self._lose(text, name_taken=False)

    def _lose(self, text: str, name_taken: bool) -> None:
        if not self._ending:
            self._node.report(RosStatus("refused", text))
            self._node.lost(name_taken)
