"""The environment variables of a process that uses one robot's ROS: its bridge, or the robot check.

ROS nodes connect to each other by the host names that they advertise. If this network does not know a robot's host
names, its host aliases give their addresses: libnss-wrapper reads the file `NSS_WRAPPER_HOSTS` first, and then asks the
system as usual.
"""

from __future__ import annotations

import ctypes.util
import os
from pathlib import Path

from robots.registry.configuration.addresses import is_address
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import Ros1, ros1
from robots.shared.sentences import say

LIBRARY = "nss_wrapper"
ONE_ARENA = {"MALLOC_ARENA_MAX": "1"}  # each of 50 threads would keep memory of its own
# One thread for linear algebra: with several, the gate's p99 rose from 0.05 to 17 ms.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class WrapperMissing(Exception):
    """A robot has host aliases, and libnss-wrapper is not installed."""

    def __init__(self) -> None:
        super().__init__(
            say("The robot has host aliases, but libnss-wrapper is missing: apt install libnss-wrapper")
        )


def ros_environment(config: BridgeConfig, run_dir: Path) -> dict[str, str]:
    """Return the environment variables; write the robot's hosts file into `run_dir`. Raises `WrapperMissing`."""
    environment = {
        name: value for name, value in os.environ.items() if name not in {"ROS_IP", "ROS_HOSTNAME"}
    }
    environment |= ONE_THREAD | ONE_ARENA
    environment["ROS_HOME"] = str(Path(config.state_dir) / "ros")
    environment["PYTHONUNBUFFERED"] = "1"
    environment["PYTHONFAULTHANDLER"] = "1"  # after a crash, the log shows where it happened
    return environment | _ros1_environment(ros1(config.ros), run_dir / f"{config.robot_id}.hosts")


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
