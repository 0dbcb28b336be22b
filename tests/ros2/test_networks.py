"""Robots that are found in real networks: by static peers, by a network that comes late, by a discovery server.

Networks are network namespaces of Linux, which only root can make.
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import uuid
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import pytest

from robots.shared import wire
from robots.shared.configuration.bridge_config import Topic
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.configuration.watchdog_config import WatchdogConfig
from robots.shared.ros2.environment import WHEELS, domain_environment, ros_environment
from robots.supervisor import ros_environment as supervisor
from tests.bridge.support import CONFIG
from tests.processes import free_port, until
from tests.ros2.side import PATIENCE_S, Side, needs_rclpy
from tests.ros2.test_check_robot import check  # noqa: F401  (a fixture)

pytestmark = needs_rclpy
needs_networks = pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("ip") is None, reason="only root can make networks, with iproute2"
)
SERVE = "42"  # as `fastdds discovery` asks that program
ROBOT, CONSOLE = "10.99.0.1", "10.99.0.2"


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


class Network:
    """Two computers with a cable between them."""

    def __init__(self) -> None:
        self.robot, self.console = (f"fleet{os.getpid()}{name}" for name in "rc")
        for name in (self.robot, self.console):
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
        ends = ("link", "add", "cable", "netns", self.robot, "type", "veth", "peer", "name", "cable")
        ip(*ends, "netns", self.console)
        for name in (self.robot, self.console):
            ip("-n", name, "link", "set", "cable", "up")

    def number(self, name: str, address: str) -> None:
        ip("-n", name, "addr", "add", f"{address}/24", "dev", "cable")

    def renumber(self, name: str, before: str, address: str) -> None:
        ip("-n", name, "addr", "del", f"{before}/24", "dev", "cable")
        self.number(name, address)

    def close(self) -> None:
        for name in (self.robot, self.console):
            ip("netns", "del", name)


def on(name: str) -> dict[str, Any]:
    """Return how a process starts on one of the computers, searching in its networks."""
    return {"within": ["ip", "netns", "exec", name], "environment": domain_environment(7, "subnet")}


@pytest.fixture
def network() -> Iterator[Network]:
    with closing(Network()) as found:
        yield found


@needs_networks
def test_static_peers_find_all_processes_without_multicast(network: Network, tmp_path: Path) -> None:
    network.number(network.robot, ROBOT)
    network.number(network.console, CONSOLE)
    silent = domain_environment(7, "off", ["127.0.0.1"])  # it neither announces itself nor hears others
    robots = {"within": on(network.robot)["within"], "environment": silent}
    with closing(Side("tests.ros2.many_nodes", 7, "robot", "9", **robots)) as robot:
        robot.await_line("up")
        ros = Ros2(7, static_peers=(ROBOT,))
        asking = supervisor.ros_environment(
            msgspec.structs.replace(CONFIG, ros=ros, state_dir=str(tmp_path)), Path("/nowhere")
        )
        within = ["ip", "netns", "exec", network.console]
        with closing(
            Side("tests.ros2.many_nodes", 7, "console", "9", environment=asking, within=within)
        ) as console:
            console.await_line("found")


def watchdog_of(network: Network, folder: Path) -> Side:
    folder.mkdir(exist_ok=True)
    config = WatchdogConfig(
        robot_id=uuid.uuid4(),
        slug="tiago",
        ros=Ros2(7),
        node="/fleet_watchdog_0",
        drive=Topic("/key_vel", "geometry_msgs/msg/Twist"),
        actions=(),
        lane=str(folder / "lane"),
        state_dir=str(folder),
    )
    side = Side("robots.bridge.watchdog", 7, msgspec.json.encode(config).decode(), **on(network.console))
    until(Path(config.lane).exists, "the watchdog listens")
    return side


@needs_networks
def test_a_network_that_comes_late_is_used(network: Network, tmp_path: Path) -> None:
    """Bridge and watchdog end, and the supervisor starts them again. The new ones find the robot."""
    network.number(network.robot, ROBOT)
    bridge = Side("tests.ros2.bridge_side", 7, "7", str(tmp_path), "subnet", **on(network.console))
    watchdog = watchdog_of(network, tmp_path)
    with closing(Side("tests.ros2.robot_side", 7, **on(network.robot))) as robot:
        assert bridge.await_line("status")[1] == "waiting"
        network.number(network.console, CONSOLE)
        assert bridge.await_line("lost") == ["lost", "False"]
        assert watchdog.process.wait(PATIENCE_S) == 1
        bridge.close(kill=True)
        with closing(
            Side("tests.ros2.bridge_side", 7, "7", str(tmp_path), "subnet", **on(network.console))
        ) as again:
            again.await_line("odometry")
            second = watchdog_of(network, tmp_path / "second")
            with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as lane:
                lane.connect(str(tmp_path / "second" / "lane"))
                lane.send(wire.encode(wire.LinkStop("ann", press=uuid.uuid4())))
                assert robot.await_line("twist") == ["twist", "0.0", "0.0"]
            network.renumber(network.console, CONSOLE, "10.99.0.3")  # another address by DHCP
            assert again.await_line("lost") == ["lost", "False"]
            assert second.process.wait(PATIENCE_S) == 1
    watchdog.close()
    second.close()


@pytest.mark.django_db
def test_a_robot_is_found_by_its_discovery_server(check, domain: int) -> None:  # noqa: F811
    server = f"127.0.0.1:{free_port()}"
    address, port = server.split(":")
    command = [str(WHEELS / "bin" / "fast-discovery-server"), SERVE, "-i", "0", "-l", address, "-p", port]
    with subprocess.Popen(
        command, env=os.environ | ros_environment([WHEELS]), stdin=subprocess.PIPE
    ) as serving:
        try:
            asking = domain_environment(domain, "subnet") | {"ROS_DISCOVERY_SERVER": server}
            asking["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
            with closing(Side("tests.ros2.robot_side", domain, environment=asking)):
                answers = check(domain_id=domain, discovery="subnet", discovery_server=server)
        finally:
            serving.kill()
    assert answers["odometry"]["level"] == "ok"
    assert "/base listens to /key_vel" in answers["drive"]["text"]
