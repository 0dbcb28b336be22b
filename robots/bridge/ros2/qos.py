"""Quality of service of the bridge's topics: with it, every publisher and every listener of the robot is heard.

A subscription that asks for less than a publisher offers gets its messages; one that asks for more gets none. So
sensors are read best effort and volatile, whatever their publishers offer. What was published once before the bridge
came (map, description) is asked for only where its publishers keep it.
"""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def sensor(depth: int) -> QoSProfile:
    """Return the profile with which messages of a sensor are read, from any publisher."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )


def pictures(offered: Iterable[QoSProfile]) -> QoSProfile:
    """Return the profile with which pictures are read: reliable if all publishers offer it.

    A picture travels in hundreds of datagrams, of which best effort repeats none: five of six pictures were lost.
    """
    profiles = list(offered)
    sure = bool(profiles) and all(one.reliability == ReliabilityPolicy.RELIABLE for one in profiles)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE if sure else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )


def kept(offered: Iterable[QoSProfile]) -> QoSProfile:
    """Return the profile with which the message that stays is read: from the publishers that keep theirs, if any does.

    A stranger that keeps none, or whose best effort would bring nobody what is kept, must not hide it.
    """
    profiles = list(offered)
    keeping = [one for one in profiles if one.durability == DurabilityPolicy.TRANSIENT_LOCAL]
    sure = [one for one in keeping if one.reliability == ReliabilityPolicy.RELIABLE]
    return as_offered(sure or keeping or profiles)


def as_offered(offered: Iterable[QoSProfile]) -> QoSProfile:
    """Return the profile that asks for as much as all publishers offer, so that each is heard."""
    profiles = list(offered)
    keep = bool(profiles) and all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in profiles)
    sure = bool(profiles) and all(one.reliability == ReliabilityPolicy.RELIABLE for one in profiles)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE if sure else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if keep else DurabilityPolicy.VOLATILE,
    )


# Reliable reaches listeners that ask for best effort too. Never kept for listeners that come later: an old twist would
# move the robot.
DRIVE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
# Of /tf_static: each of its publishers keeps all its transforms in one message.
STATIC = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# Of messages that must all come: trajectories, poses, feedback of actions.
EVENTS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
# Of services that are asked once: one answer waits in DDS.
ONE_ANSWER = DRIVE
# Of cancels. A request that was lost is sent again only while no newer ones have taken its place. Nobody reads the
# answers: so many of them wait in DDS, and a stranger's may be large.
CANCELS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=4,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
