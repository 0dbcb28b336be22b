"""The environment variables of a process that uses one robot's ROS: its bridge, or the robot check.

ROS 1 nodes connect to each other by the host names that they advertise. If this network does not know a robot's host
names, its host aliases give their addresses: libnss-wrapper reads the file `NSS_WRAPPER_HOSTS` first, and then asks the
system as usual.

ROS 2 nodes find each other in a domain. The loader reads where the libraries of rclpy are only when a process starts.
"""

from __future__ import annotations

import ctypes.util
import os
from pathlib import Path

from robots.registry.configuration.addresses import is_address
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import Ros1, Ros2
from robots.shared.ros2 import environment as wheels
from robots.shared.sentences import say
from robots.supervisor import distribution
from robots.supervisor.unready import Unready

LIBRARY = "nss_wrapper"
ONE_ARENA = {"MALLOC_ARENA_MAX": "1"}  # each of 50 threads would keep memory of its own
# One thread for linear algebra: with several, the gate's p99 rose from 0.05 to 17 ms.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# The console's own, of a shell: a robot's entry alone says how it is reached.
NOT_INHERITED = {
    *("ROS_IP", "ROS_HOSTNAME", "ROS_MASTER_URI"),
    *("ROS_DOMAIN_ID", "ROS_LOCALHOST_ONLY", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"),
    *("ROS_DISCOVERY_SERVER", "ROS_SUPER_CLIENT", wheels.PROFILE, wheels.PROFILE_BEFORE),
}


class WrapperMissing(Unready):
    """A robot has host aliases, and libnss-wrapper is not installed."""

    def __init__(self) -> None:
        super().__init__(
            say("The robot has host aliases, but libnss-wrapper is missing: apt install libnss-wrapper")
        )


class RclpyMissing(Unready):
    """A robot has ROS 2, and nobody has installed rclpy here."""

    def __init__(self) -> None:
        super().__init__(
            say("The robot’s bridge needs rclpy, which is not installed on its computer: script/setup ros2")
        )


def ros_environment(config: BridgeConfig, run_dir: Path) -> dict[str, str]:
    """Return the environment variables; write a ROS 1 robot's hosts file into `run_dir`. Raises `Unready`."""
    environment = {name: value for name, value in os.environ.items() if name not in NOT_INHERITED}
    environment |= ONE_THREAD | ONE_ARENA
    environment["ROS_HOME"] = str(Path(config.state_dir) / "ros")
    environment["PYTHONUNBUFFERED"] = "1"
    environment["PYTHONFAULTHANDLER"] = "1"  # after a crash, the log shows where it happened
    environment["PYTHONNODEBUGRANGES"] = "1"  # tables of columns, which only underline a line of a traceback
    if isinstance(config.ros, Ros2):
        return environment | _ros2_environment(config.ros)
    return environment | _ros1_environment(config.ros, run_dir / f"{config.robot_id}.hosts")


def _ros1_environment(ros: Ros1, hosts: Path) -> dict[str, str]:
    environment = {"ROS_MASTER_URI": ros.master_uri}
    if ros.advertised_address:
        variable = "ROS_IP" if is_address(ros.advertised_address) else "ROS_HOSTNAME"
        environment[variable] = ros.advertised_address
    if ros.host_aliases:
        environment |= _aliases(ros, hosts)
    return environment


def _aliases(ros: Ros1, hosts: Path) -> dict[str, str]:
    library = ctypes.util.find_library(LIBRARY)
    if library is None:
        raise WrapperMissing
    fresh = hosts.with_suffix(f".{os.getpid()}")
    fresh.write_text("".join(f"{address} {name}\n" for name, address in ros.host_aliases.items()))
    fresh.replace(hosts)  # a running bridge never reads half a file
    preload = ":".join(filter(None, [os.environ.get("LD_PRELOAD"), library]))
    return {"LD_PRELOAD": preload, "NSS_WRAPPER_HOSTS": str(hosts)}


def _ros2_environment(ros: Ros2) -> dict[str, str]:
    if ros.setup:
        given = distribution.variables(ros.setup)
        environment = {name: value for name, value in given.items() if name not in NOT_INHERITED}
    elif wheels.READY.is_file() and wheels.site_packages(wheels.WHEELS).is_dir():
        environment = wheels.ros_environment([wheels.MESSAGES, wheels.WHEELS])
        environment["PYTHONPATH"] = _without_ros(os.environ.get("PYTHONPATH", ""))
    else:
        raise RclpyMissing
    if not ros.discovery_server:
        environment |= wheels.domain_environment(ros.domain_id, ros.discovery, ros.static_peers)
        if ros.setup and (profile := environment.get(wheels.PROFILE)):
            environment[wheels.PROFILE_BEFORE] = profile  # Kilted and later warn of it
        return environment
    environment |= wheels.domain_environment(ros.domain_id, "subnet")
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    # Without the second, the server tells a node only of nodes that have its topics.
    return environment | {"ROS_DISCOVERY_SERVER": ros.discovery_server, "ROS_SUPER_CLIENT": "TRUE"}


def _without_ros(paths: str) -> str:
    """Leave out the folders of a distribution that somebody's shell has set up: Python would import its packages."""
    folders = paths.split(os.pathsep)
    return os.pathsep.join(
        one for one in folders if not any((Path(one) / name).is_dir() for name in ("rclpy", "std_msgs"))
    )
