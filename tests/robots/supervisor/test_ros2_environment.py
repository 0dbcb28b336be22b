"""The environment of a ROS 2 robot's processes: its domain, and where rclpy is."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec
import pytest

from robots.shared.configuration.robot_ros import Ros2
from robots.shared.ros2 import environment as wheels
from robots.supervisor.ros_environment import ros_environment
from robots.supervisor.unready import Unready
from tests.bridge.support import CONFIG


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Rclpy as `script/setup ros2` installs it."""
    for name in ("WHEELS", "MESSAGES"):
        monkeypatch.setattr(wheels, name, tmp_path / name)
        (tmp_path / name).mkdir()
    monkeypatch.setattr(wheels, "READY", tmp_path / "MESSAGES" / "ready")
    wheels.READY.touch()
    wheels.site_packages(wheels.WHEELS).mkdir(parents=True)
    return tmp_path / "WHEELS"


def environment_of(ros: Ros2) -> dict[str, str]:
    return ros_environment(msgspec.structs.replace(CONFIG, ros=ros), Path("/nowhere"))


def test_a_robot_is_reached_by_its_own_domain_and_no_other(installed, monkeypatch) -> None:
    of_a_shell = ("ROS_MASTER_URI", "ROS_DOMAIN_ID", "ROS_LOCALHOST_ONLY", "ROS_DISCOVERY_SERVER")
    for name in (*of_a_shell, "FASTDDS_DEFAULT_PROFILES_FILE"):
        monkeypatch.setenv(name, "1")
    found = environment_of(Ros2(7, "off", ("10.68.0.1", "tiago-42c")))
    assert {name: value for name, value in found.items() if name.startswith(("ROS_", "FASTDDS_"))} == {
        "ROS_HOME": f"{CONFIG.state_dir}/ros",
        "ROS_DOMAIN_ID": "7",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": "10.68.0.1;tiago-42c",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
        "FASTDDS_DEFAULT_PROFILES_FILE": str(Path(wheels.__file__).with_name("only_peers.xml")),
    }
    assert str(installed / "lib") in found["LD_LIBRARY_PATH"].split(":")


def test_static_peers_are_asked_for_many_processes_beside_multicast(installed) -> None:
    found = environment_of(Ros2(7, "subnet", ("10.68.0.1",)))
    assert found["ROS_STATIC_PEERS"] == "239.255.0.1;10.68.0.1"
    profile = Path(found["FASTDDS_DEFAULT_PROFILES_FILE"]).read_text()
    assert "<maxInitialPeersRange>64<" in profile and "<useBuiltinTransports>false<" in profile


@pytest.mark.parametrize(
    "ros",
    [Ros2(7, "subnet"), Ros2(7, "off", ("10.68.0.1",)), Ros2(7), Ros2(7, discovery_server="10.68.0.1:11811")],
)
def test_no_search_asks_a_robot_for_its_types(installed, ros: Ros2) -> None:
    """One lost answer would hide a robot's topics for good (tests/ros2/test_found_again.py)."""
    profile = Path(environment_of(ros)["FASTDDS_DEFAULT_PROFILES_FILE"]).read_text()
    assert "<name>fastdds.type_propagation</name><value>disabled</value>" in "".join(profile.split())


def test_a_robot_on_this_computer_is_searched_nowhere_else(installed) -> None:
    found = environment_of(Ros2(7, "localhost"))
    profile = Path(found["FASTDDS_DEFAULT_PROFILES_FILE"]).read_text()
    assert "<interfaceWhiteList>\n          <address>127.0.0.1</address>" in profile
    assert environment_of(Ros2(7, "localhost", ("10.68.0.1",)))["ROS_STATIC_PEERS"] == "127.0.0.1;10.68.0.1"


def test_with_a_discovery_server_nothing_is_searched(installed) -> None:
    found = environment_of(Ros2(7, discovery_server="10.68.0.1:11811"))
    assert (found["ROS_DISCOVERY_SERVER"], found["ROS_SUPER_CLIENT"]) == ("10.68.0.1:11811", "TRUE")
    assert found["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"


def test_packages_of_a_shell_do_not_come_before_the_console_s_own(
    installed, tmp_path: Path, monkeypatch
) -> None:
    sourced, mine = tmp_path / "humble", tmp_path / "mine"
    for folder in (sourced / "std_msgs", mine):
        folder.mkdir(parents=True)
    monkeypatch.setenv("PYTHONPATH", f"{sourced}:{mine}")
    assert environment_of(Ros2())["PYTHONPATH"] == str(mine)


@pytest.mark.parametrize("lacks", [lambda: wheels.READY, lambda: wheels.site_packages(wheels.WHEELS)])
def test_without_rclpy_for_this_python_the_robot_says_what_to_install(installed, lacks) -> None:
    """After an upgrade of Python its packages are in the folder of the Python before."""
    lacks().rename(installed / "before")
    with pytest.raises(
        Unready, match="bridge needs rclpy, which is not installed on its computer: script/setup ros2"
    ):
        environment_of(Ros2())


def distribution(folder: Path, python: str = wheels.VERSION, more: str = "") -> str:
    """Write a set-up script and the place of its rclpy; return the script's path."""
    packages = folder / "lib" / python / "site-packages"
    (packages / "rclpy").mkdir(parents=True)
    script = folder / "setup.bash"
    count = f"echo run >>{folder}/runs; echo words of the script"
    script.write_text(f"{count}\nexport AMENT_PREFIX_PATH={folder} PYTHONPATH={packages}\n{more}\n")
    return str(script)


def test_the_set_up_script_of_a_distribution_runs_once(tmp_path: Path) -> None:
    script = distribution(tmp_path)
    for _ in range(2):
        found = environment_of(Ros2(7, setup=script))
        assert (found["AMENT_PREFIX_PATH"], found["ROS_DOMAIN_ID"]) == (str(tmp_path), "7")
    assert (tmp_path / "runs").read_text() == "run\n"
    os.utime(script, ns=(1, 1))
    found = environment_of(Ros2(7, "localhost", setup=script))
    assert found["FASTRTPS_DEFAULT_PROFILES_FILE"] == found["FASTDDS_DEFAULT_PROFILES_FILE"]
    assert (tmp_path / "runs").read_text() == "run\nrun\n"


def test_a_script_may_have_run_in_this_shell_before(tmp_path: Path, monkeypatch) -> None:
    script = distribution(tmp_path)
    packages = tmp_path / "lib" / wheels.VERSION / "site-packages"
    monkeypatch.setenv("PYTHONPATH", str(packages))
    assert environment_of(Ros2(setup=script))["PYTHONPATH"] == str(packages)


@pytest.mark.parametrize(
    ("python", "more", "mode", "said"),
    [
        ("python3.4", "", 0o755, "is made for python3.4, the console runs with"),
        (wheels.VERSION, "export PYTHONPATH=", 0o755, "offers no rclpy"),
        (wheels.VERSION, "false", 0o755, "failed"),
        (wheels.VERSION, "", 0o777, "other people of that computer can change it"),
    ],
)
def test_a_distribution_that_cannot_be_used_says_why(tmp_path: Path, python, more, mode, said) -> None:
    script = distribution(tmp_path, python, more)
    Path(script).chmod(mode)
    with pytest.raises(Unready, match=said):
        environment_of(Ros2(setup=script))


def test_a_script_that_is_gone_is_named() -> None:
    with pytest.raises(Unready, match=r"/nowhere/setup\.bash of ROS cannot be read \(No such file"):
        environment_of(Ros2(setup="/nowhere/setup.bash"))
