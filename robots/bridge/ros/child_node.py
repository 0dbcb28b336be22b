"""The rospy node of a process beside the bridge, such as the inspector. It ends with the robot's master."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import rospy

from robots.bridge.ros.bounds.install import install
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import ros1
from robots.shared.processes.memory import end_without_memory
from robots.shared.processes.vital import start_vital
from robots.shared.ros.master import DeathWatch

log = logging.getLogger(__name__)

WATCH_S = 5.0


def join(config: BridgeConfig, name: str, at_end: Callable[[], object] = lambda: None) -> None:
    """Start the node under a unique name that begins with `name`: other consoles have such processes too.

    `at_end` is called before the process ends with the master.
    """
    master_uri = ros1(config.ros).master_uri
    os.environ["ROS_MASTER_URI"] = master_uri
    os.environ.setdefault("ROS_LOG_DIR", str(Path(config.state_dir) / "ros-log"))
    watch = DeathWatch(master_uri)
    install(lambda: end_without_memory(lambda: os._exit(1)))
    rospy.init_node(
        name.strip("/"),
        argv=[],
        anonymous=True,
        disable_signals=True,
        disable_rostime=True,
        disable_rosout=True,
    )
    start_vital(partial(_end_with_the_master, watch, at_end), "master")


@contextmanager
def joined(name: str, config: BridgeConfig) -> Iterator[None]:
    """Context: the node under a unique name that begins with `name`."""
    join(config, name)
    yield
    leave()


def leave() -> None:
    """Unregister from the master."""
    rospy.signal_shutdown("nobody looks")


def _end_with_the_master(watch: DeathWatch, at_end: Callable[[], object]) -> None:
    while not watch.wait(WATCH_S):
        pass
    log.warning("the robot's ROS master is gone")
    at_end()
    os._exit(1)
