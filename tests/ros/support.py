"""A real rosmaster, simulated robots and a ROS client for tests and benchmarks.

rospy supports one master per process. So each test process (each pytest-xdist worker) has its own
master on a free port and at most one node; each robot runs in a separate process.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
from geometry_msgs.msg import Pose2D
from nav_msgs.msg import Odometry

from robots.bridge.ros.tasks.publishing import immediate_publisher
from tests.forked import ForkedProgram
from tests.messages import Messages
from tests.processes import PATIENCE_S, REPOSITORY, end, free_port, until

ROSMASTER = "/usr/bin/rosmaster"
# rospy also logs while the interpreter exits: pytest's streams are then closed.
logging.getLogger("rospy").setLevel(logging.WARNING)
LAST_TOPIC = "/scan"  # the last topic that a simulator advertises, for every base


class Master:
    """A separate rosmaster. A test can kill it and start it again on the same port."""

    def __init__(self, folder: Path, port: int | None = None) -> None:
        self.port = port or free_port()
        self.uri = f"http://127.0.0.1:{self.port}/"
        self._folder = folder
        self.process: ForkedProgram | None = None

    def environment(self) -> dict[str, str]:
        """Return the environment of processes that use this master."""
        return {
            **os.environ,
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(self._folder),
            "ROS_LOG_DIR": str(self._folder / "log"),
            "ROS_PYTHON_LOG_CONFIG_FILE": str(REPOSITORY / "robots/simulator/ros/logging.yaml"),
            "PYTHONWARNINGS": "ignore",
        }

    def start(self) -> Master:
        """Start the master and wait until it answers."""
        (self._folder / "log").mkdir(parents=True, exist_ok=True)
        words, log = (ROSMASTER, "--core", "-p", str(self.port)), self._folder / "rosmaster.log"
        self.process = self.fork(*words, log=log)
        until(self.answers, f"rosmaster on port {self.port}")
        return self

    def fork(self, program: str, *arguments: str, log: Path, **changes: str) -> ForkedProgram:
        """Start a program that uses the master, with these changes of its environment."""
        return ForkedProgram(program, *arguments, log=log, environment=self.environment() | changes)

    def answers(self) -> bool:
        """Return whether the master answers."""
        try:
            ServerProxy(self.uri).getPid("/test")
        except OSError:
            return False
        return True

    def kill(self) -> None:
        """Kill the master with SIGKILL, as in a crash."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()

    def stop(self) -> None:
        """End it."""
        if self.process is not None:
            end(self.process)


def simulator_words(name: str, **options: Any) -> list[str]:
    """Return the program and the arguments of a simulated robot."""
    flags = [
        f"--{key.replace('_', '-')}" + ("" if value is True else f"={value}")
        for key, value in options.items()
    ]
    return ["robots.simulator", f"--name={name}", "--exit-with-parent", *flags]


class SimulatorProcess:
    """One process ``python -m robots.simulator`` that uses a master."""

    def __init__(
        self, master: Master, log: Path, name: str, environment: dict[str, str] | None = None, **options: Any
    ) -> None:
        self.name = name
        self.node = f"/simulator_{name}".replace("-", "_")
        self.log = log
        self._master = master
        self.process = master.fork(*simulator_words(name, **options), log=log, **(environment or {}))

    def wait_ready(self) -> SimulatorProcess:
        """Wait until the simulator's topics are registered."""
        until(self._is_ready, f"simulator {self.name}; its log:\n{self.log.read_text()}")
        return self

    def stop(self) -> int:
        """End it; return its exit code."""
        code = end(self.process)
        self.process.stdin.close()
        return code

    def _is_ready(self) -> bool:
        if self.process.poll() is not None:
            raise AssertionError(
                f"the simulator ended with {self.process.returncode}:\n{self.log.read_text()}"
            )
        return is_up(self._master, self.node)


def is_up(master: Master, node: str) -> bool:
    """Return whether this node of a simulator has registered all its topics."""
    published, _, _ = rosgraph.Master("/test", master.uri).getSystemState()
    return any(topic == LAST_TOPIC and node in nodes for topic, nodes in published)


class Inbox(Messages):
    """The messages of one topic, in order of arrival."""

    def __init__(self, topic: str, kind: type) -> None:
        super().__init__(topic)
        self._subscriber = rospy.Subscriber(topic, kind, self.put, tcp_nodelay=True)

    @property
    def publishers(self) -> int:
        """Number of connected publishers."""
        count: int = self._subscriber.get_num_connections()
        return count

    def close(self) -> None:
        """Stop listening."""
        self._subscriber.unregister()


def is_at(pose: Any, x: float, y: float, heading: float) -> bool:
    """Return whether a pose, as messages of either ROS have it, is this one."""
    turned = math.remainder(2.0 * math.atan2(pose.orientation.z, pose.orientation.w) - heading, math.tau)
    return math.dist((pose.position.x, pose.position.y), (x, y)) < 0.01 and abs(turned) < 0.01


class RosClient:
    """The only ROS node of this process. The `ros` fixture makes it once."""

    def __init__(self, master: Master) -> None:
        self.master = master
        environment = master.environment()
        for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "ROS_LOG_DIR", "ROS_PYTHON_LOG_CONFIG_FILE"):
            os.environ[name] = environment[name]
        rospy.init_node("test", anonymous=True, disable_signals=True, disable_rosout=True)

    @contextmanager
    def listen(self, topic: str, kind: type) -> Iterator[Inbox]:
        """Subscribe for the length of a `with` block."""
        inbox = Inbox(topic, kind)
        try:
            yield inbox
        finally:
            inbox.close()

    @contextmanager
    def speak(self, topic: str, kind: type, listeners: int = 1) -> Iterator[rospy.Publisher]:
        """Publish for the length of a `with` block. The block begins when `listeners` subscribers are connected.

        Messages are sent at once: messages in a queue would be lost when the block ends.
        """
        publisher = immediate_publisher(topic, kind, PATIENCE_S)
        try:
            until(lambda: publisher.get_num_connections() >= listeners, f"{listeners} listeners on {topic}")
            yield publisher
        finally:
            publisher.unregister()

    @contextmanager
    def at(self, pose: Pose2D) -> Iterator[None]:
        """Place the simulated robot: the test before may have left it anywhere."""
        with (
            self.listen("/ground_truth/pose", Odometry) as truth,
            self.speak("/ground_truth/teleport", Pose2D) as teleport,
        ):
            teleport.publish(pose)
            truth.until(lambda message: is_at(message.pose.pose, pose.x, pose.y, pose.theta))
            yield

    def connected(self, *inboxes: Inbox) -> None:
        """Wait until each inbox has a publisher: messages sent before are lost."""
        until(lambda: all(inbox.publishers for inbox in inboxes), "publishers of what is listened to")

    def close(self) -> None:
        """Leave the master."""
        rospy.signal_shutdown("the tests are over")
