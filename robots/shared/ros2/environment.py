"""The environment of a process that uses rclpy: from the wheels in `.ros2`, or from an installed distribution.

The loader reads `LD_LIBRARY_PATH` only when a process starts, so whoever starts one sets it: it cannot be set later.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[3]
WHEELS = ROOT / ".ros2"  # what `script/setup ros2` installs
MESSAGES = WHEELS / "messages"  # packages generated from definitions
MULTICAST = "239.255.0.1"  # where nodes announce themselves
# With static peers, they do so nowhere else, so these addresses become peers too.
_BESIDE_PEERS = {"subnet": (MULTICAST,), "localhost": ("127.0.0.1",), "off": ()}
PROFILE = "FASTDDS_DEFAULT_PROFILES_FILE"
PROFILE_BEFORE = "FASTRTPS_DEFAULT_PROFILES_FILE"  # until Jazzy
SOCKET_BYTES = (
    4 * 1024 * 1024
)  # of what came and was not read yet; the kernel may allow less (net.core.rmem_max)
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


def domain_environment(
    domain: int, discovery: str = "localhost", peers: Sequence[str] = ()
) -> dict[str, str]:
    """Return the variables that say with which participants of DDS a process speaks, and that it does so by UDP.

    In shared memory, files of dead processes and of other people would stand in the way, and ROS's own ranges LOCALHOST
    and OFF use it whatever they are told: profiles of Fast DDS stand in for them.

    The profiles also keep Fast DDS from asking each robot for its types: it repeats no answer that a full socket lost,
    and the topics of these types would never be found. rclpy knows its types without asking.
    """
    found = {"ROS_DOMAIN_ID": str(domain), "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}
    found |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    found["ROS_STATIC_PEERS"] = ";".join([*_BESIDE_PEERS[discovery], *peers]) if peers else ""
    profile = "subnet" if discovery == "subnet" else "only_peers"
    if discovery != "subnet" and not peers:
        found["ROS_AUTOMATIC_DISCOVERY_RANGE"], profile = "SYSTEM_DEFAULT", "only_here"
    return found | {PROFILE: str(Path(__file__).with_name(f"{profile}.xml"))}


@contextmanager
def wide_sockets() -> Iterator[None]:
    """Context in which this process joins a domain, to let large pictures wait: best effort repeats nothing.

    The kernel's usual 208 KiB do not hold one. Not for bridge and watchdog: what waits there, a stop waits behind.
    """
    present = {name: os.environ[name] for name in (PROFILE, PROFILE_BEFORE) if os.environ.get(name)}
    wide = f"<type>UDPv4</type><receiveBufferSize>{SOCKET_BYTES}</receiveBufferSize>"
    with TemporaryDirectory(prefix="fleet-") as folder:
        for name, path in present.items():
            text = Path(path).read_text(encoding="utf-8").replace("<type>UDPv4</type>", wide)
            os.environ[name] = str(Path(folder, f"{name}.xml"))
            Path(os.environ[name]).write_text(text, encoding="utf-8")
        try:
            yield
        finally:
            os.environ.update(present)


def _main() -> None:
    """Print the variables of a process in this domain, on this computer only."""
    variables = ros_environment([MESSAGES, WHEELS]) | domain_environment(int(sys.argv[1]))
    sys.stdout.writelines(f"{name}={value}\n" for name, value in variables.items())


def _joined(folders: Iterable[Path], inherited: str) -> str:
    return os.pathsep.join([*map(str, folders), *filter(None, [inherited])])


if __name__ == "__main__":
    _main()
