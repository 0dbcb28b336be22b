"""Publishing on topics that rospy may close at any moment: a namesake on the master ends it from outside."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401 isort: skip

from typing import Any

import rospy
from rospy.core import is_shutdown_requested


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Send it; nothing once rospy shuts down (topics are closed first), which `RosBase` notices and answers for."""
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not is_shutdown_requested():
            raise
