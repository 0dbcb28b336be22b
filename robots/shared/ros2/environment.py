"""The environment of a process that uses rclpy: from the wheels in `.ros2`, or from an installed distribution.

The loader reads `LD_LIBRARY_PATH` only when a process starts, so whoever starts one sets it: it cannot be set later.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
WHEELS = ROOT / ".ros2"  # what `script/setup ros2` installs
MESSAGES = WHEELS / "messages"  # packages generated from definitions
MANY_PEERS = Path(__file__).with_name("many_peers.xml")
MULTICAST = "239.255.0.1"  # where nodes announce themselves; with static peers they do so there no more
READY = MESSAGES / "ready"  # written when both are whole
VERSION = f"python{sys.version_info.major}.{sys.version_info.minor}"
# The wheels start Python again with the libraries' folders, unless this is set.
BOOTSTRAPPED = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"


def site_packages(prefix: Path) -> Path:
    """Return the folder of a prefix that has its Python packages."""
    return prefix / "lib" / VERSION / "site-packages"


def ros_environment(prefixes: Iterable[Path], inherited: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Return the variables with which a process finds the libraries and packages of these prefixes.

    `robots.bridge.ros2` adds their Python packages behind the console's own, which are to win.
    """
    found = [prefix for prefix in prefixes if prefix.is_dir()]
    packages = [site_packages(prefix) for prefix in found]
    libraries = [prefix / "lib" for prefix in found]
    libraries += [folder for each in packages for folder in sorted(each.glob("ros_*.libs"))]
    return {
        "AMENT_PREFIX_PATH": _joined(found, inherited.get("AMENT_PREFIX_PATH", "")),
        "LD_LIBRARY_PATH": _joined(libraries, inherited.get("LD_LIBRARY_PATH", "")),
        BOOTSTRAPPED: "1",
    }


def domain_environment(domain: int, discovery: str = "LOCALHOST", peers: str = "") -> dict[str, str]:
    """Return the variables that say with which participants of DDS a process speaks."""
    return {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": discovery,
        "ROS_STATIC_PEERS": peers,
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }


def _main() -> None:
    """Print the variables of a process in this domain, on this computer only."""
    variables = ros_environment([MESSAGES, WHEELS]) | domain_environment(int(sys.argv[1]))
    sys.stdout.writelines(f"{name}={value}\n" for name, value in variables.items())


def _joined(folders: Iterable[Path], inherited: str) -> str:
    return os.pathsep.join([*map(str, folders), *filter(None, [inherited])])


if __name__ == "__main__":
    _main()
