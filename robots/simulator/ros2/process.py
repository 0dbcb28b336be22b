"""One simulator process in a domain of ROS 2: runs until the end signal, and cleans up.

Whoever starts it sets the environment of `robots.shared.ros2.environment`: the domain, and where rclpy is.
"""

from __future__ import annotations

import logging
import sys
import threading

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, ShutdownException
from rclpy.signals import SignalHandlerOptions

from robots.shared.processes.shutdown import end_event
from robots.simulator.node import CameraOptions, node_name
from robots.simulator.robot import Robot
from robots.simulator.ros2.node import simulator_node
from robots.simulator.ros2.side import RclpySide

log = logging.getLogger(__name__)

_END_S = 5.0  # from the end signal to the exit, even if a part hangs


def run(
    robot: Robot, name: str, cameras: CameraOptions, exit_with_parent: bool, namespace: str, *, later: bool
) -> None:
    """Run `robot` until SIGTERM, SIGINT or, if asked, the end of standard input."""
    stop = end_event(sys.stdin.fileno() if exit_with_parent else None, _END_S)
    context = Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    ros = RclpySide(node_name(name), namespace, context)
    node = simulator_node(ros, robot, name, cameras, later=later)
    spinning = threading.Thread(target=_spin, args=(ros, stop), name="ros2", daemon=True)
    spinning.start()
    try:
        log.info("%s is up in domain %d", name, context.get_domain_id())
        node.run(stop)
    finally:
        node.close()
        ros.close()
        spinning.join(_END_S)
        rclpy.shutdown(context=context)


def _spin(ros: RclpySide, stop: threading.Event) -> None:
    try:
        ros.spin()
    except (ExternalShutdownException, ShutdownException):
        pass
    finally:
        stop.set()  # a robot that hears nothing must not seem alive
