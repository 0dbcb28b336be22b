"""``python -m robots.bridge.ros2.camera``: the camera process of a robot with ROS 2."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from robots.bridge.camera.process import run
from robots.bridge.ros2.camera.camera_topics import CameraTopics
from robots.bridge.ros2.participant import Participant
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import ros2
from robots.shared.graph import CAMERA
from robots.shared.ros2.environment import wide_sockets

LEAVE_S = 0.5


class Domain:
    """The robot's domain, as long as the process runs."""

    @contextmanager
    def joined(self, config: BridgeConfig) -> Iterator[None]:
        """Context: a node in the domain."""
        self._ros = ros2(config.ros)
        with wide_sockets():
            self._participant = Participant(f"{CAMERA.strip('/')}_{os.getpid()}", self._ros.domain_id)
        self._participant.start()
        yield
        self._participant.close(LEAVE_S)

    def cameras(self, base: str) -> CameraTopics:
        """Return what subscribes to cameras."""
        return CameraTopics(self._participant, self._ros.namespace, base)


if __name__ == "__main__":
    domain = Domain()
    run(domain.cameras, domain.joined)
