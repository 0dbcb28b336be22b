"""Registers a node again after a restart of the master: rospy registers it only once in a process's life."""

from __future__ import annotations

import rospy
from rospy.impl.registration import get_service_manager, get_topic_manager

from robots.shared.ros.master import Master


def register_again(master: Master) -> None:
    """Register this process's node again, with all its topics, at a restarted master."""
    own_uri = rospy.get_node_uri()
    for topic, kind in get_topic_manager().get_publications():
        master.register("registerPublisher", topic, kind, own_uri)
    for topic, kind in get_topic_manager().get_subscriptions():
        publishers = master.register("registerSubscriber", topic, kind, own_uri)
        # The master also makes this call for a new subscriber.
        Master(own_uri, "/master").call("publisherUpdate", topic, publishers)
    for service, service_uri in get_service_manager().get_services():
        master.call("registerService", service, service_uri, own_uri)
