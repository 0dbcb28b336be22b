"""Subscriptions whose messages nobody decodes on rospy's threads."""

from __future__ import annotations

from collections.abc import Callable

import rospy

from robots.bridge.ros.bounds.sizes import expect

BUFFER_BYTES = 1 << 20  # of one read; a picture has some hundred kilobytes to some megabytes


def listen(
    topic: str, type_name: str, take: Callable[[bytes], None], queue: int | None = None
) -> rospy.Subscriber:
    """Subscribe to a topic of this type; `take` gets the bytes of each message, on a rospy thread."""
    expect(topic, type_name)
    return rospy.Subscriber(
        topic,
        rospy.AnyMsg,
        lambda message: take(message._buff),
        queue_size=queue,
        buff_size=BUFFER_BYTES,
        tcp_nodelay=True,
    )
