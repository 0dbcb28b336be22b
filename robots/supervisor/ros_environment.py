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
    environment["ROS_MASTER_URI"] = config.master_uri
    environment["ROS_HOME"] = str(Path(config.state_dir) / "ros")
    environment["PYTHONUNBUFFERED"] = "1"
    environment["PYTHONFAULTHANDLER"] = "1"  # after a crash, the log shows where it happened
    if config.advertised_address:
        variable = "ROS_IP" if is_address(config.advertised_address) else "ROS_HOSTNAME"
        environment[variable] = config.advertised_address
    if config.host_aliases:
        environment |= _aliases(config, run_dir, environment.get("LD_PRELOAD", ""))
    return environment


def _aliases(config: BridgeConfig, run_dir: Path, preloaded: str) -> dict[str, str]:
    library = ctypes.util.find_library(LIBRARY)
    if library is None:
        raise WrapperMissing
    hosts = run_dir / f"{config.robot_id}.hosts"
    fresh = hosts.with_suffix(f".{os.getpid()}")
    fresh.write_text("".join(f"{address} {name}\n" for name, address in config.host_aliases.items()))
    fresh.replace(hosts)  # a running bridge never reads half a file
    preload = ":".join(filter(None, [preloaded, library]))
    return {"LD_PRELOAD": preload, "NSS_WRAPPER_HOSTS": str(hosts)}
