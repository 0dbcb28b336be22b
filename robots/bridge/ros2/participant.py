"""This process in the robot's domain: one context, one node, one executor on a thread of its own."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from functools import wraps
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

log = logging.getLogger(__name__)


class Participant:
    """A node that nobody outside can move, shut down or reconfigure: it has no services and reads no arguments."""

    def __init__(self, name: str, namespace: str, domain: int) -> None:
        self._context = Context()
        rclpy.init(
            args=[],
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = Node(
            name,
            namespace=namespace,
            context=self._context,
            cli_args=[],
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        # The EventsExecutor of Kilted needs less, but hands over one message of a raw subscription and then none.
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name="ros2", daemon=True)

    def start(self) -> None:
        """Call the callbacks of subscriptions from now on."""
        self._thread.start()

    def close(self, patience_s: float) -> None:
        """Leave the domain."""
        self._executor.shutdown(patience_s)
        self._thread.join(patience_s)
        rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
        except Exception:
            log.exception("the executor failed")
            raise


def guarded(callback: Callable[..., None]) -> Callable[..., None]:
    """Return a callback that no message can make fail: an exception would end the executor."""

    @wraps(callback)  # rclpy asks for its parameters: with two, it gets what is known about the message too
    def call(*message: Any) -> None:
        try:
            callback(*message)
        except Exception:  # any content of a stranger's message
            log.debug("a message could not be read", exc_info=True)

    return call
