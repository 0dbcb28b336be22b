"""Questions and answers of the probe (`network.probe` of the robot's side) about a robot's ROS: only facts."""

from __future__ import annotations

from typing import Literal
from uuid import UUID

from msgspec import Struct

from robots.shared.configuration.bridge_config import ArmSource, Topic
from robots.shared.configuration.robot_ros import Ros
from robots.shared.wire.base import Worded

CALLER = "/fleet_check"  # the probe's node name
BRIDGE = "/fleet_bridge"  # the bridge's node name, the same from every console: a second bridge is refused
WATCHDOG = "/fleet_watchdog"  # prefix of a watchdog's node name; it publishes only zeros

TYPE = "type"
FEEDBACK = "_FeedbackMessage"  # behind the type of an action of ROS 2: what its server tells of a goal


def watchdog_name(robot_id: str) -> str:
    """Return the node name of this console's watchdog of a robot: no other console has that robot id."""
    return f"{WATCHDOG}_{UUID(robot_id).hex[:12]}"


class Listened(Struct, frozen=True):
    """A topic to subscribe to. `stamped`: its messages begin with a std_msgs/Header."""

    what: str
    topic: str
    type: str
    stamped: bool
    frames: list[str] = []  # expected frame ids
    kept: Literal["no", "may", "must"] = "no"  # of ROS 2: by publishers, for listeners that come later


class Misfit(Struct, frozen=True):
    """A node of ROS 2 that is not connected with another one, because of one policy of quality of service.

    Policies and values are named as ROS 2 names them, such as "durability", "volatile", "transient local". `TYPE` may
    stand in a policy's place.
    """

    node: str
    policy: str
    offered: str
    asked: str


class Plan(Struct, frozen=True):
    """The questions."""

    ros: Ros
    drive: Topic
    listened: list[Listened]
    listen_s: float = 2.0
    arm: ArmSource | None = None  # the arm that the robot's description should have
    commands: dict[str, Topic] = {}  # what is published beside velocities, such as the head's trajectories


class HostFound(Struct, frozen=True):
    """A host name of the robot's nodes. `address` None: it does not resolve; `error`: it is not reachable."""

    name: str
    nodes: int
    address: str | None = None
    error: str | None = None


class CallbackFound(Worded, frozen=True):
    """Result of the test whether the master can call us at our advertised address."""

    SENTENCES = ("error",)

    advertised: str
    called: bool
    route: str | None = None  # our address in the master's network
    error: str | None = None


class TopicFound(Worded, frozen=True):
    """One topic as its first reachable publisher offers it."""

    SENTENCES = ("error",)

    what: str
    publishers: list[str]
    type: str | None = None  # as offered
    md5: str | None = None  # of ROS 2: type hash
    our_md5: str | None = None  # None: the type is unknown here
    messages: int = 0
    frames: list[str] = []
    skew_s: float | None = None  # stamp minus our clock, of the message with the largest difference
    error: str | None = None
    ranges: dict[str, float] = {}  # of sonars, by frame id; metres
    misfits: list[Misfit] = []  # publishers of ROS 2 that keep too little for the console


class DriveFound(Struct, frozen=True):
    """The drive topic, or another one that gets commands: publishers, subscribers, its type if it is another one."""

    publishers: list[str]
    subscribers: list[str]
    type: str | None
    refused: list[
        Misfit
    ] = []  # subscribers of ROS 2 that get nothing, because they ask for more than is offered
    differing: list[str] = []  # subscribers of ROS 2 with another version of the type
    takes: str = ""  # with ROS 2: the type in which these subscribers take velocities


class DescriptionFound(Worded, frozen=True):
    """The robot's description, and the parts of the arm that it lacks. `error`: why this is unknown."""

    SENTENCES = ("error",)

    links: list[str] = []
    joints: list[str] = []
    unplaced: list[str] = []  # links that it has, but whose places are not known
    error: str | None = None
    text: str = ""


class Findings(Worded, frozen=True):
    """All answers. `master_error` None: the master, or the domain, answers; otherwise the rest is empty."""

    SENTENCES = ("master_error",)

    master_error: str | None = None
    hosts: list[HostFound] = []
    callback: CallbackFound | None = None
    topics: list[TopicFound] = []
    drive: DriveFound | None = None
    description: DescriptionFound | None = None
    clock_is_simulated: bool = False
    commands: dict[str, DriveFound] = {}  # by `Plan.commands`
    twins: list[str] = []  # of ROS 2: names that several nodes have
    namespaces: list[str] = []  # of ROS 2: where the robot is in place of the one that the registry has
