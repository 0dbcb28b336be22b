"""One simulator process: joins the robot's master, runs until told to stop, leaves nothing behind."""

from __future__ import annotations

import logging
import os
import re
import signal
import sys
import threading
from pathlib import Path

from robots.bridge.ros import path  # noqa: F401  (first: makes rospy importable)

# isort: split
import rosgraph
import rospy

from robots.simulator.robot import Robot
from robots.simulator.ros.node import SimulatorNode
from robots.simulator.ros.registration import watch_registration

log = logging.getLogger(__name__)

_MASTER_RETRY_S = 0.2


def run(robot: Robot, name: str, depth_encoding: str, exit_with_parent: bool) -> None:
    """Run `robot` as one ROS node until SIGTERM, SIGINT or, if asked, the end of standard input."""
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    if exit_with_parent:
        threading.Thread(target=_watch_parent, args=(stop,), daemon=True).start()
    if not _wait_for_master(stop):
        return
    os.environ.setdefault("ROS_PYTHON_LOG_CONFIG_FILE", str(Path(__file__).with_name("logging.yaml")))
    rospy.init_node(_node_name(name), disable_signals=True)
    node = SimulatorNode(robot, name, depth_encoding)
    try:
        log.info("%s is up at %s", name, rosgraph.get_master_uri())
        watch_registration(stop, node.set_parameters)
        node.run(stop)
    finally:
        node.close()
        rospy.signal_shutdown("the simulator was told to stop")


def _node_name(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_]", "_", f"simulator_{name}")


def _watch_parent(stop: threading.Event) -> None:
    """Standard input is the life line: it ends when the parent does, however it ends."""
    # Not sys.stdin.read(): a thread inside it would abort the interpreter's own exit.
    while os.read(sys.stdin.fileno(), 4096):
        pass
    stop.set()


def _wait_for_master(stop: threading.Event) -> bool:
    """True when the master answers; False when told to stop first."""
    told = False
    while not rosgraph.is_master_online():
        if not told:
            log.info("waiting for a master at %s", rosgraph.get_master_uri())
            told = True
        if stop.wait(_MASTER_RETRY_S):
            return False
    return True
