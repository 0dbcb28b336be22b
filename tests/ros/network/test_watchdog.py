"""A stop reaches the robot and holds, also without the bridge: real processes, real master, simulated robot."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCServer

import msgspec
import pytest
import rosgraph
from geometry_msgs.msg import Twist

from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig, LinkAddress
from robots.shared.processes.probe_findings import BRIDGE, watchdog_name
from robots.shared.processes.shutdown import EXIT_NAME_LOST
from tests.processes import PATIENCE_S, until
from tests.ros.bridge_support import BridgeProcess, Hand, WatchdogProcess, drivable, tiago_config
from tests.ros.support import Master, RosClient
from tests.zeros import Zeros

DRIVE = "/key_vel"


@pytest.fixture(scope="module", autouse=True)
def robot(rosmaster, simulator):
    return simulator(pose="2,1.8,0", seed=1, drift=0)


@pytest.fixture
def config(rosmaster: Master, tmp_path) -> BridgeConfig:
    return tiago_config(rosmaster, tmp_path)


@pytest.fixture
def start(rosmaster: Master, config: BridgeConfig, tmp_path) -> Iterator[Callable[[Any], Any]]:
    """Start this robot's bridge or watchdog."""
    with ExitStack() as ending:

        def begin(kind: Any) -> Any:
            process = kind(config, rosmaster, tmp_path)
            ending.callback(process.stop)
            return process

        yield begin


@pytest.fixture
def watchdog(start) -> WatchdogProcess:
    return start(WatchdogProcess).ready()


@pytest.fixture
def bridge(start, watchdog: WatchdogProcess) -> BridgeProcess:
    return start(BridgeProcess)


@pytest.fixture
def hand(bridge: BridgeProcess) -> Iterator[Hand]:
    hand = bridge.link()
    hand.state_until(drivable, "the robot to be online")
    hand.take_control(1)
    yield hand
    hand.close()


@pytest.fixture
def zeros(ros: RosClient, config: BridgeConfig) -> Iterator[Zeros]:
    with ros.listen(DRIVE, Twist) as inbox:
        yield Zeros(inbox, watchdog_name(config.robot_id), _caller)


def _caller(message: Any) -> str:
    caller: str = message._connection_header["callerid"]
    return caller


@contextmanager
def usurper(master: Master, name: str) -> Iterator[None]:
    """Start a node with the same name: the master then ends the console's node."""
    script = "import rospy, sys; rospy.init_node(sys.argv[1], disable_signals=True); print(1, flush=True); rospy.spin()"
    process = subprocess.Popen(
        ["/usr/bin/python3", "-c", script, name.strip("/")], env=master.environment(), stdout=subprocess.PIPE
    )
    try:
        assert process.stdout is not None and process.stdout.readline()
        yield
    finally:
        process.kill()
        process.communicate()


def turn(hand: Hand) -> None:
    """Turn the robot on the spot and keep the stick there."""

    def turns(state: wire.State) -> bool:
        hand.stick(0.0, 0.0 if state.neutral_needed else 0.5)
        return state.odometry is not None and state.odometry.w > 0.1

    hand.state_until(turns, "the robot to turn")


def uri_of(master: Master, node: str) -> str:
    return rosgraph.Master("/test", master.uri).lookupNode(node)


def test_a_thief_of_the_bridges_name_ends_it_but_no_stop(
    hand: Hand, bridge: BridgeProcess, watchdog: WatchdogProcess, rosmaster: Master, zeros: Zeros, start
) -> None:
    turn(hand)
    with usurper(rosmaster, BRIDGE):
        assert isinstance(watchdog.press("Ann", "smoke"), wire.Stopped)
        zeros.of_the_watchdog(20)
        assert zeros.none_but_zeros()
        assert bridge.process.wait(PATIENCE_S) == EXIT_NAME_LOST
    again = start(BridgeProcess).link()
    assert again.state_until(drivable, "the next bridge").stop.by == "Ann"
    again.close()


def test_a_short_thief_of_the_bridges_name_leaves_a_live_bridge(
    hand: Hand, bridge: BridgeProcess, rosmaster: Master
) -> None:
    stranger = ServerProxy(rosmaster.uri)
    stranger.registerPublisher(BRIDGE, "/somewhere", "std_msgs/String", "http://127.0.0.1:9/")
    stranger.unregisterPublisher(BRIDGE, "/somewhere", "http://127.0.0.1:9/")
    assert bridge.process.wait(PATIENCE_S) == EXIT_NAME_LOST


def test_no_shutdown_call_ends_bridge_or_watchdog(
    hand: Hand, bridge: BridgeProcess, watchdog: WatchdogProcess, rosmaster: Master, config: BridgeConfig
) -> None:
    for node in (BRIDGE, watchdog_name(config.robot_id)):
        for caller in ("/master", "/stranger"):
            code, text, _ = ServerProxy(uri_of(rosmaster, node)).shutdown(caller, "new node registered")
            assert (code, "refused" in text) == (0, True)
    turn(hand)
    assert isinstance(watchdog.press(), wire.Stopped)
    assert "shutdown call of /master was refused" in bridge.log.read_text()
    assert (bridge.process.poll(), watchdog.process.poll()) == (None, None)


def test_a_node_that_takes_the_watchdogs_name_loses_it(
    watchdog: WatchdogProcess, rosmaster: Master, config: BridgeConfig, zeros: Zeros
) -> None:
    name = watchdog_name(config.robot_id)
    before = uri_of(rosmaster, name)
    with usurper(rosmaster, name):
        until(lambda: uri_of(rosmaster, name) == before, "the name to be the watchdog's again")
    watchdog.press()
    zeros.of_the_watchdog()


def test_the_watchdog_comes_back_to_a_restarted_master(make_master, simulator, tmp_path) -> None:
    master = make_master()
    robot = simulator(master=master)
    config = tiago_config(master, tmp_path)
    watchdog = WatchdogProcess(config, master, tmp_path).ready()
    try:
        before = uri_of(master, watchdog_name(config.robot_id))
        master.kill()
        master.start()
        robot.wait_ready()
        until(lambda: _registered(master, watchdog_name(config.robot_id)) == before, "the watchdog")
        assert isinstance(watchdog.press(), wire.Stopped)
    finally:
        watchdog.stop()


def _registered(master: Master, node: str) -> str | None:
    try:
        return uri_of(master, node)
    except (OSError, rosgraph.MasterException):
        return None


def test_a_second_watchdog_of_a_robot_fights_for_no_name(
    watchdog: WatchdogProcess, rosmaster: Master, config: BridgeConfig, zeros: Zeros, tmp_path
) -> None:
    """As of a console with a copy of the database: both stop the robot."""
    name = watchdog_name(config.robot_id)
    before = uri_of(rosmaster, name)
    folder = tmp_path / "copy"
    folder.mkdir()
    copy = msgspec.structs.replace(
        config, link=LinkAddress(unix_path=f"{config.link.unix_path}2.sock"), state_dir=str(folder)
    )
    second = WatchdogProcess(copy, rosmaster, folder).ready()
    try:
        assert isinstance(second.press("Ben"), wire.Stopped)
        assert isinstance(watchdog.press("Ann"), wire.Stopped)
        zeros.of_the_watchdog()
        assert uri_of(rosmaster, name) == before
    finally:
        second.stop()
    assert "has this name: if another console runs there" in second.log.read_text()


def test_a_name_that_is_taken_again_and_again_is_left(
    watchdog: WatchdogProcess, rosmaster: Master, config: BridgeConfig, start
) -> None:
    name = watchdog_name(config.robot_id)
    own = uri_of(rosmaster, name)
    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as thief:
        thief.register_function(lambda *_: (1, "", name), "getName")
        thief.register_function(lambda *_: (1, "", 0), "shutdown")
        threading.Thread(target=thief.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{thief.server_address[1]}/"

        def steal() -> bool:
            if _registered(rosmaster, name) == own:
                ServerProxy(rosmaster.uri).registerPublisher(name, "/somewhere", "std_msgs/String", address)
            return watchdog.process.poll() is not None

        until(steal, "the end of the watchdog")
        watchdog.log.unlink()
        assert isinstance(start(WatchdogProcess).ready().press(), wire.Stopped)
        assert _registered(rosmaster, name) == address
        thief.shutdown()
