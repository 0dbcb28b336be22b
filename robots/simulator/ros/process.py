"""One simulator process: joins the robot's master, runs until the end signal, and cleans up."""

from __future__ import annotations

import logging
import os
import sys
import threading
from functools import partial
from pathlib import Path

import rosgraph
import rospy

from robots.shared.processes.shutdown import end_event
from robots.shared.ros.master import Master, MasterError
from robots.simulator.node import CameraOptions, node_name
from robots.simulator.robot import Robot
from robots.simulator.ros.node import set_parameters, simulator_node
from robots.simulator.ros.registration import watch_registration

log = logging.getLogger(__name__)

_MASTER_RETRY_S = 0.2
_FAREWELL_S = 1.0  # time to unregister from a master that answers
_END_S = 5.0  # from the end signal to the exit, even if a part hangs


def run(robot: Robot, name: str, cameras: CameraOptions, exit_with_parent: bool) -> None:
    """Run `robot` as one ROS node until SIGTERM, SIGINT or, if asked, the end of standard input."""
    stop = end_event(sys.stdin.fileno() if exit_with_parent else None, _END_S)
    if not _wait_for_master(stop):
        return
    os.environ.setdefault("ROS_PYTHON_LOG_CONFIG_FILE", str(Path(__file__).with_name("logging.yaml")))
    rospy.init_node(node_name(name), disable_signals=True)
    set_robot = partial(set_parameters, robot, name)
    set_robot()
    node = simulator_node(robot, cameras)
    try:
        log.info("%s is up at %s", name, rosgraph.get_master_uri())
        watch_registration(stop, set_robot)
        node.run(stop)
    finally:
        node.close()
        _take_leave()


def _take_leave() -> None:
    """Unregister from the master, with a time limit: rospy would wait forever for a hanging master."""
    leaving = threading.Thread(
        target=rospy.signal_shutdown, args=("the simulator was asked to stop",), daemon=True
    )
    leaving.start()
    leaving.join(_FAREWELL_S)


def _wait_for_master(stop: threading.Event) -> bool:
    """Wait for the master. Return False if the process must end before the master answers."""
    master = Master(rosgraph.get_master_uri(), "/simulator")
    is_reported = False
    while True:
        try:
            master.alive()
            return True
        except MasterError as error:
            if not is_reported:
                log.info("waiting for a master: %s", error)
                is_reported = True
        if stop.wait(_MASTER_RETRY_S):
            return False
