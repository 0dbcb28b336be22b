"""Registers a node again after a restart of the master: rospy registers it only once in a process's life."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from robots.shared.ros.master import Master

_Pairs = Iterable[tuple[str, str]]


class Topics(Protocol):
    """rospy's manager of the node's topics: pairs of topic and type."""

    def get_publications(self) -> _Pairs: ...
    def get_subscriptions(self) -> _Pairs: ...


class Services(Protocol):
    """rospy's manager of the node's services: pairs of service and address."""

    def get_services(self) -> _Pairs: ...


def register_again(master: Master, own_uri: str, topics: Topics, services: Services) -> None:
    """Register this process's node again, with all its topics and services, at a restarted master."""
    for topic, kind in topics.get_publications():
        master.register("registerPublisher", topic, kind, own_uri)
    for topic, kind in topics.get_subscriptions():
        publishers = master.register("registerSubscriber", topic, kind, own_uri)
        # The master also makes this call for a new subscriber.
        Master(own_uri, "/master").call("publisherUpdate", topic, publishers)
    for service, service_uri in services.get_services():
        master.call("registerService", service, service_uri, own_uri)
