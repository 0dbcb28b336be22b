"""Quality of service of two sides of a topic: DDS connects them only if one offers what the other asks for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from robots.bridge.ros2.network.graph import node_name
from robots.shared.processes.probe_findings import Misfit

ENDLESS_NS = 2**62  # rclpy's endless time is near; 0 stands for it, too
NO_TIME = "none"


def refused(offered: QoSProfile, listeners: Iterable[TopicEndpointInfo]) -> list[Misfit]:
    """Return the listeners that ask for more than is offered, each with the first policy."""
    found = ((node_name(one), _misfit(offered, one.qos_profile)) for one in listeners)
    return [Misfit(node, *why) for node, why in found if why]


def lacking(publishers: Iterable[TopicEndpointInfo], asked: QoSProfile) -> list[Misfit]:
    """Return the publishers that offer less than is asked for, each with the first policy."""
    found = ((node_name(one), _misfit(one.qos_profile, asked)) for one in publishers)
    return [Misfit(node, *why) for node, why in found if why]


def _misfit(offered: QoSProfile, asked: QoSProfile) -> tuple[str, str, str] | None:
    """Return policy, offered and asked value of the first policy that keeps two sides apart."""
    return next(_misfits(offered, asked), None)


def _misfits(offered: QoSProfile, asked: QoSProfile) -> Iterator[tuple[str, str, str]]:
    if (offered.durability, asked.durability) == (
        DurabilityPolicy.VOLATILE,
        DurabilityPolicy.TRANSIENT_LOCAL,
    ):
        yield "durability", "volatile", "transient local"
    if (offered.reliability, asked.reliability) == (
        ReliabilityPolicy.BEST_EFFORT,
        ReliabilityPolicy.RELIABLE,
    ):
        yield "reliability", "best effort", "reliable"
    if _longer(offered.deadline, asked.deadline):
        yield "deadline", _time(offered.deadline), _time(asked.deadline)
    manual = LivelinessPolicy.MANUAL_BY_TOPIC
    if asked.liveliness == manual != offered.liveliness:
        yield "liveliness", "automatic", "manual by topic"
    if _longer(offered.liveliness_lease_duration, asked.liveliness_lease_duration):
        times = _time(offered.liveliness_lease_duration), _time(asked.liveliness_lease_duration)
        yield "liveliness lease duration", *times


def _longer(offered: Duration, asked: Duration) -> bool:
    return _nanoseconds(offered) > _nanoseconds(asked)


def _nanoseconds(time: Duration) -> int:
    return min(int(time.nanoseconds) or ENDLESS_NS, ENDLESS_NS)


def _time(time: Duration) -> str:
    nanoseconds = _nanoseconds(time)
    return NO_TIME if nanoseconds == ENDLESS_NS else f"{nanoseconds / 1e9:g} s"
