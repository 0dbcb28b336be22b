"""A robot's processes resolve its host names and advertise the right address."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest import mock

import msgspec
import pytest

from robots.registry.models import Robot
from robots.registry.selectors import bridge_config
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.supervisor.ros_environment import WrapperMissing, ros_environment

RESOLVE = "import socket, sys; print(socket.gethostbyname(sys.argv[1]))"


@pytest.fixture
def config(robot: Robot, tmp_path: Path) -> BridgeConfig:
    return msgspec.structs.replace(bridge_config(robot), state_dir=str(tmp_path))


def reached(config: BridgeConfig, **changes: Any) -> BridgeConfig:
    return msgspec.structs.replace(config, ros=msgspec.structs.replace(config.ros, **changes))


def resolved(environment: dict[str, str], name: str) -> str:
    arguments = [sys.executable, "-c", RESOLVE, name]
    return subprocess.run(
        arguments, env=environment, capture_output=True, text=True, check=True
    ).stdout.strip()


def test_an_alias_resolves_only_for_the_robots_processes(config: BridgeConfig, tmp_path: Path) -> None:
    aliased = reached(config, host_aliases={"tiago-42c": "10.68.0.1"})
    environment = ros_environment(aliased, tmp_path)
    assert resolved(environment, "tiago-42c") == "10.68.0.1"
    assert resolved(environment, "localhost") == "127.0.0.1"


def test_without_aliases_nothing_is_preloaded(config: BridgeConfig, tmp_path: Path) -> None:
    environment = ros_environment(config, tmp_path)
    assert "NSS_WRAPPER_HOSTS" not in environment
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("address", "variable"), [("10.68.0.2", "ROS_IP"), ("console.lab", "ROS_HOSTNAME")])
def test_the_advertised_address_goes_where_ros_looks_for_it(
    config: BridgeConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str, variable: str
) -> None:
    for inherited in ("ROS_IP", "ROS_HOSTNAME"):
        monkeypatch.setenv(inherited, "192.0.2.9")
    environment = ros_environment(reached(config, advertised_address=address), tmp_path)
    addresses = {name: environment[name] for name in ("ROS_IP", "ROS_HOSTNAME") if name in environment}
    assert addresses == {variable: address}


def test_a_missing_libnss_wrapper_is_named_with_its_package(config: BridgeConfig, tmp_path: Path) -> None:
    aliased = reached(config, host_aliases={"tiago-42c": "10.68.0.1"})
    missing = mock.patch("ctypes.util.find_library", autospec=True, return_value=None)
    with missing, pytest.raises(WrapperMissing, match="apt install libnss-wrapper"):
        ros_environment(aliased, tmp_path)
