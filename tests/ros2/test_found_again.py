"""A bridge after one that was killed finds its robot, also on a busy computer whose sockets lose datagrams."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

from tests.ros.bridge_support import BridgeProcess, WatchdogProcess, drivable
from tests.ros2.conftest import OPTIONS, free_domain
from tests.ros2.side import Side, needs_rclpy
from tests.sides.side import Ros2Side

pytestmark = needs_rclpy

ROBOTS, BRIDGES = 4, 25  # Fast DDS that asks for types lost the robot of one bridge in 30, for good


def test_each_bridge_after_a_killed_one_finds_its_robot(tmp_path: Path) -> None:
    folders = [tmp_path / str(number) for number in range(ROBOTS)]
    with ThreadPoolExecutor(ROBOTS) as pool:
        list(pool.map(killed_again_and_again, folders))


def killed_again_and_again(folder: Path) -> None:
    folder.mkdir()
    with free_domain() as domain, closing(Side("robots.simulator", domain, *OPTIONS)):
        network = Ros2Side(domain)
        config = network.config(folder)
        for _ in range(BRIDGES):
            watchdog, bridge = (kind(config, network, folder) for kind in (WatchdogProcess, BridgeProcess))
            try:
                with closing(bridge.link()) as hand:
                    hand.state_until(drivable, "the robot to be online")
                for each in (bridge, watchdog):
                    each.kill()
            finally:
                bridge.stop()
                watchdog.stop()
