"""Publishing on topics that rospy may close at any moment: a namesake on the master ends it from outside."""

from __future__ import annotations

from robots.bridge.ros import path  # noqa: F401 isort: skip

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from rospy.core import is_shutdown_requested

PATIENCE_S = 1.0  # a message waits so long for somebody who listens: connections take some milliseconds


def publish(publisher: rospy.Publisher, message: Any) -> None:
    """Send it; nothing once rospy shuts down (topics are closed first), which `RosBase` notices and answers for."""
    try:
        publisher.publish(message)
    except rospy.ROSException:
        if not is_shutdown_requested():
            raise


class Sender(rospy.SubscribeListener):  # type: ignore[misc]
    """A topic whose newest message waits a moment for its listeners, if it has none yet."""

    def __init__(self, topic: str, kind: type[Any]) -> None:
        self._lock = threading.Lock()
        self._waiting: tuple[Any, float] | None = None  # message, and until when
        self.publisher = rospy.Publisher(topic, kind, subscriber_listener=self, queue_size=5)

    def send(self, message: Any) -> None:
        """To who listens now, else to who begins to within `PATIENCE_S`."""
        with self._lock:
            heard = self.publisher.get_num_connections() > 0
            self._waiting = None if heard else (message, time.monotonic() + PATIENCE_S)
        if heard:
            publish(self.publisher, message)

    def withdraw(self) -> None:
        """Send to nobody what nobody has heard yet."""
        with self._lock:
            self._waiting = None

    def close(self) -> None:
        """Leave the topic."""
        self.withdraw()
        self.publisher.unregister()

    # --- on rospy's threads ------------------------------------------------------------------------

    def peer_subscribe(self, _topic: str, _all: Callable[[Any], None], peer: Callable[[Any], None]) -> None:
        """Somebody begins to listen. rospy guards each publication with this lock, except the one to a single peer."""
        with self._lock:
            if self._waiting is not None and time.monotonic() < self._waiting[1]:
                self.publisher.impl.acquire()
                try:
                    peer(self._waiting[0])
                finally:
                    self.publisher.impl.release()
