"""The watchdog's part in a robot's domain. It only publishes, so that no message of the robot can delay it."""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from functools import partial
from typing import TYPE_CHECKING

from rclpy.exceptions import InvalidHandle

from robots.bridge.ros2.drive import FLUSH_S, Drives, publish_still
from robots.bridge.ros2.network.graph import Graph
from robots.bridge.ros2.network.interfaces import Joined
from robots.bridge.ros2.network.survey import Listeners, wanted_kind
from robots.bridge.ros2.participant import Participant
from robots.bridge.ros2.tasks.cancels import Cancels
from robots.shared.configuration.robot_ros import ros2
from robots.shared.configuration.watchdog_config import WatchdogConfig

if TYPE_CHECKING:
    from collections.abc import Callable

    from robots.bridge.robot.interface import StopSide

log = logging.getLogger(__name__)

LOOK_S = 1.0  # between two looks at the type of velocities, and at the networks of this computer
LEAVE_S = 1.0
ZEROED_S = 3.0  # after a zero that reached the robot, more may be due: this process must not end


class WatchdogNode:
    """Publishes zeros and cancels at one robot."""

    def __init__(self, config: WatchdogConfig) -> None:
        self._config = config
        self._participant: Participant | None = None
        self._wanted = {config.drive.name}
        self._twist = config.drive.type  # of velocities, as the robot takes them
        self._drives = Drives()
        self._cancels: Cancels | None = None
        self._listeners: Listeners
        self._zeroed_s = -math.inf  # when a zero reached the robot last
        self._news = threading.Event()
        self._ending = False

    def start(self) -> None:
        """Join the robot's domain on a separate thread."""
        threading.Thread(target=self._keep_joined, name="domain", daemon=True).start()

    def stop(self) -> None:
        """Leave the robot's domain."""
        self._ending = True
        self._news.set()
        if self._participant is not None:
            time.sleep(FLUSH_S)  # the last zero leaves before the participant does
            self._participant.close(LEAVE_S)

    # --- called by the watchdog (watchdog.process.Watchdog) --------------------------------------------

    def zero(self) -> int:
        """Publish a zero velocity on every drive topic; returns the number of nodes that it was written to."""
        reached = 0
        for name, publisher in list(self._drives.by_topic.items()):
            try:
                publish_still(publisher)
                reached += self._listeners.of(name, publisher)
            except InvalidHandle as error:  # its topic is being closed
                log.warning("a zero was not published: %s", error)
        if reached:
            self._zeroed_s = time.monotonic()
        return reached

    def cancel(self) -> None:
        """Cancel the goals of all clients."""
        if self._cancels is not None:
            self._cancels.cancel_all()

    def drive_to(self, topic: str) -> None:
        """Publish zeros on this topic from now on, in addition to the default topic. Returns at once."""
        wanted = {self._config.drive.name, topic}
        if wanted != self._wanted:
            self._wanted = wanted
            self._news.set()

    # --- on the thread for the domain ------------------------------------------------------------------

    def _keep_joined(self) -> None:
        ros, drive = ros2(self._config.ros), self._config.drive
        joined = Joined(ros)
        try:
            self._participant = participant = Participant(self._config.node.strip("/"), ros.domain_id)
            self._listeners = Listeners(Graph(participant.node))
            graph = Graph(participant.node)  # of this thread
            listeners = Listeners(graph)
            self._cancels = Cancels(participant.node, self._config.actions, ros.namespace)
            self._drives.connect(participant.node, self._wanted, self._twist)
            participant.work(partial(self._look, self._cancels), "actions")
            log.info("joined the robot's domain as %s", self._config.node)
            while not self._ending:
                self._twist = wanted_kind(graph, drive, self._twist)
                self._drives.connect(participant.node, self._wanted, self._twist)
                self._news.wait(LOOK_S)
                self._news.clear()
                if not self._ending and self._is_cut_off(joined, listeners):
                    log.warning(
                        "this computer has joined another network: another process joins the robot again"
                    )
                    os._exit(1)
        except Exception:
            if not self._ending:
                log.exception("joining the robot's domain failed")
                os._exit(1)

    def _look(self, cancels: Cancels) -> None:
        """Look for actions, on a thread of its own: strangers can make this slow, and the drive topic must not wait."""
        while not self._ending:
            cancels.look()
            time.sleep(LOOK_S)

    def _is_cut_off(self, joined: Joined, listeners: Listeners) -> bool:
        """Return whether zeros may not reach a robot that a new process would reach."""
        if not joined.new() or time.monotonic() - self._zeroed_s < ZEROED_S:
            return False
        return joined.moved() or not any(listeners.of(*each) for each in self._drives.by_topic.items())


if TYPE_CHECKING:
    SIDE: Callable[[WatchdogConfig], StopSide] = WatchdogNode
