"""Monitors the robot's master: joins it, surveys it while it lives, and registers again after a restart."""

from __future__ import annotations

import logging
import threading
from contextlib import closing
from time import monotonic
from typing import Protocol
from urllib.parse import urlsplit

import rospy
from rospy.impl.registration import get_service_manager, get_topic_manager

from robots.bridge.robot_reports import RosStatus
from robots.shared.graph import SystemState
from robots.shared.processes.probe_findings import BRIDGE
from robots.shared.ros.master import DeathWatch, Master, MasterError, node_alive, require_ipv4
from robots.shared.ros.registration import register_again
from robots.shared.sentences import say

log = logging.getLogger(__name__)

RETRY_S = 0.5
SURVEY_S = 2.0
SILENCE_S = 10.0  # of uninterrupted silence, after which another bridge counts as dead


class Namesake(Exception):
    """Another bridge is registered with this master, and is not known to be dead."""


class NodeLost(Exception):
    """rospy cannot be this robot's node again in this process."""

    def __init__(self, text: str, name_taken: bool) -> None:
        super().__init__(text)
        self.name_taken = name_taken


class Node(Protocol):
    """Callbacks of the monitor, called on its thread."""

    def join(self) -> None:
        """Join the master by rospy: the master answers, and no other bridge is registered. Called once."""

    def restarting(self) -> None:
        """Handle a restarted master, before registrations are repeated: then the first messages of its run come."""

    def restarted(self) -> None:
        """Handle a restarted master. All registrations were repeated."""

    def surveyed(self, system: SystemState) -> None:
        """Take the present publishers and subscribers."""

    def report(self, status: RosStatus) -> None:
        """Take the reason why the robot is not joined."""

    def lost(self, name_taken: bool) -> None:
        """Handle the loss of the node: its name was taken, or `join` failed. A new process must follow."""


class MasterMonitor:
    """Watches the master on its own thread, and survives any answer of a hostile or failing master."""

    def __init__(self, master: Master, node: Node) -> None:
        self._master = master
        self._node = node
        self._begun = False
        self._silent_since_s: float | None = None  # another bridge with this name
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="master", daemon=True)

    def start(self) -> None:
        """Start to search for the master."""
        self._thread.start()

    def close(self) -> None:
        """Stop monitoring. Returns at once."""
        self._ending.set()

    def _watch(self) -> None:
        while not self._ending.is_set():
            try:
                self._join_and_stay()
            except MasterError as error:
                self._node.report(RosStatus("waiting", error.args[0]))
            except Namesake as error:
                self._node.report(RosStatus("refused", error.args[0]))
            except NodeLost as error:
                if not self._ending.is_set():  # else this process itself called `rospy.signal_shutdown`
                    self._node.report(RosStatus("refused", error.args[0]))
                    self._node.lost(error.name_taken)
                return
            except Exception as error:  # without this thread no one would notice the robot's loss
                log.exception("watching the robot's master failed")
                self._node.report(
                    RosStatus(
                        "waiting", say("Watching the robot’s ROS master failed ({error}).", error=error)
                    )
                )
            self._ending.wait(RETRY_S)

    def _join_and_stay(self) -> None:
        self._require_name()
        self._master.alive()
        with closing(DeathWatch(self._master.uri)) as watch:  # first: the master may die during the join
            self._require_no_namesake()
            if self._begun:
                self._node.restarting()
                register_again(self._master, rospy.get_node_uri(), get_topic_manager(), get_service_manager())
                self._node.restarted()
            else:
                require_ipv4(self._master.uri)
                self._begin()
            self._stay(watch)

    def _begin(self) -> None:
        """Join the master. A failed join cannot be repeated: rospy starts only once, its topics exist."""
        try:
            self._node.join()
        except Exception as error:
            if not self._ending.is_set():
                log.exception("joining the robot's master failed")
            raise NodeLost(
                say("The bridge could not join the robot ({error}).", error=error), name_taken=False
            ) from error
        self._begun = True

    def _stay(self, watch: DeathWatch) -> None:
        """Survey the robot until the master is gone."""
        while not self._ending.is_set():
            self._require_name()
            self._node.surveyed(self._master.system_state())
            if watch.wait(SURVEY_S):
                raise MasterError(say("The ROS master at {uri} is gone.", uri=self._master.uri))

    def name_is_lost(self) -> bool:
        """Return whether another node took the bridge's name on the master, and maybe left again.

        Thread-safe. False if the master does not answer.
        """
        try:
            return bool(self._master.node_uri(BRIDGE) != rospy.get_node_uri())
        except MasterError:
            return False

    def _require_name(self) -> None:
        if self._begun and rospy.is_shutdown():
            raise NodeLost("Another node took this bridge’s name on the robot’s master.", name_taken=True)

    def _require_no_namesake(self) -> None:
        """Raise Namesake if another bridge lives. A silent one may be busy: it is dead after `SILENCE_S`."""
        uri = self._master.node_uri(BRIDGE)
        alive = node_alive(uri, BRIDGE) if uri and uri != rospy.get_node_uri() else False
        if alive:
            self._silent_since_s = None
            raise Namesake(
                say(
                    "Another console’s bridge on {host} drives this robot; stop that one first.",
                    host=_host(uri),
                )
            )
        if alive is None:
            now_s = monotonic()
            self._silent_since_s = self._silent_since_s or now_s
            if now_s - self._silent_since_s < SILENCE_S:
                raise Namesake(
                    say(
                        "Another console’s bridge on {host} has this robot and does not answer now. "
                        "If it stays silent, this one takes over.",
                        host=_host(uri),
                    )
                )
        self._silent_since_s = None


def _host(uri: str | None) -> str | None:
    return urlsplit(uri).hostname if uri else None
