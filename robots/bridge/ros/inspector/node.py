"""The inspector's rospy node: started by the first subscription or publication."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import rospy

from robots.bridge.config import BridgeConfig
from robots.bridge.ros.bounds.install import install
from robots.bridge.ros.bounds.memory import end_without_memory
from robots.bridge.ros.inspector.definitions import Definitions
from robots.bridge.ros.inspector.publishing import Publishers
from robots.bridge.ros.inspector.subscriptions import Subscriptions
from robots.bridge.ros.inspector.vital import start_vital
from robots.bridge.ros.network.master import INSPECTOR, DeathWatch, Master

log = logging.getLogger(__name__)

WATCH_S = 5.0


class Node:
    """Subscribes and publishes at one robot. The process ends when the master dies."""

    def __init__(
        self,
        config: BridgeConfig,
        master: Master,
        definitions: Definitions,
        send: Callable[[str, bytes], None],
    ) -> None:
        os.environ["ROS_MASTER_URI"] = config.master_uri
        os.environ["ROS_PYTHON_LOG_CONFIG_FILE"] = str(Path(__file__).parent.with_name("logging.yaml"))
        os.environ.setdefault("ROS_LOG_DIR", str(Path(config.state_dir) / "ros-log"))
        watch = DeathWatch(config.master_uri)
        install(lambda: end_without_memory(lambda: os._exit(1)))
        # A unique name: other consoles have inspectors too.
        rospy.init_node(
            INSPECTOR.strip("/"),
            argv=[],
            anonymous=True,
            disable_signals=True,
            disable_rostime=True,
            disable_rosout=True,
        )
        start_vital(partial(_end_with_the_master, watch), "master")
        self.subscriptions = Subscriptions(definitions, send)
        self.publishers = Publishers(master)

    def close(self) -> None:
        """Unregister from the master."""
        rospy.signal_shutdown("nobody looks")


def _end_with_the_master(watch: DeathWatch) -> None:
    while not watch.wait(WATCH_S):
        pass
    log.warning("the robot's ROS master is gone")
    os._exit(1)
