"""Request and findings of `robots.bridge.ros.network.probe`: facts, no judgement."""

from __future__ import annotations

from uuid import UUID

from msgspec import Struct

from robots.bridge.config import ArmSource, Topic

CALLER = "/fleet_check"  # the name under which the probe asks
BRIDGE = "/fleet_bridge"  # a bridge's, the same from every console: the second one is refused
WATCHDOG = "/fleet_watchdog"  # how a watchdog's name begins; it publishes nothing but zeros


def watchdog_name(robot_id: str) -> str:
    """The node name of this console's watchdog of a robot: no other console has that robot id."""
    return f"{WATCHDOG}_{UUID(robot_id).hex[:12]}"


class Listened(Struct, frozen=True):
    """A topic to listen to. `stamped`: its messages begin with a std_msgs/Header."""

    what: str
    topic: str
    type: str
    stamped: bool
    frames: list[str] = []  # frame ids that should be seen


class Plan(Struct, frozen=True):
    """The facts to find."""

    master_uri: str
    drive: Topic
    listened: list[Listened]
    listen_s: float = 2.0
    arm: ArmSource | None = None  # that the robot's description should have


class HostFound(Struct, frozen=True):
    """A host name that the robot's nodes go by. `address` None: it cannot be resolved; `error`: nor reached."""

    name: str
    nodes: int
    address: str | None = None
    error: str | None = None


class CallbackFound(Struct, frozen=True):
    """Whether the master could call us back under the address that we advertise."""

    advertised: str
    called: bool
    route: str | None = None  # our own address on the way to the master
    error: str | None = None


class TopicFound(Struct, frozen=True):
    """One topic as its first reachable publisher offers it."""

    what: str
    publishers: list[str]
    type: str | None = None  # as offered
    md5: str | None = None
    our_md5: str | None = None  # None: we do not know the type
    messages: int = 0
    frames: list[str] = []
    skew_s: float | None = None  # stamp less our clock, of the message that hurried most
    error: str | None = None


class DriveFound(Struct, frozen=True):
    """The drive topic: who writes, who reads, and its type as the master knows it."""

    publishers: list[str]
    subscribers: list[str]
    type: str | None


class DescriptionFound(Struct, frozen=True):
    """Missing arm links of the robot's description. `error`: the description is not usable."""

    links: list[str] = []
    joints: list[str] = []
    error: str | None = None


class Findings(Struct, frozen=True):
    """All of it. `master_error` None: the master answers; otherwise the rest is empty."""

    master_error: str | None = None
    hosts: list[HostFound] = []
    callback: CallbackFound | None = None
    topics: list[TopicFound] = []
    drive: DriveFound | None = None
    description: DescriptionFound | None = None  # of a robot with an arm
