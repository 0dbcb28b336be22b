"""Refuses rospy's `shutdown` call, which any node may make: only the supervisor ends a bridge or a watchdog."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from rospy.impl.masterslave import ROSHandler

log = logging.getLogger(__name__)

_Answer = tuple[int, str, int]
_REFUSED: _Answer = (0, "refused: only its supervisor may end this node", 0)


def refuse_shutdown(name_is_lost: Callable[[], bool] = lambda: False) -> None:
    """Refuse `shutdown` calls from now on in this process. Call it before `rospy.init_node`.

    A master calls `shutdown` when another node takes this node's name, after it has unregistered this node's topics.
    `name_is_lost` asks the master whether that happened: if so, rospy shuts down as usual.
    """
    shutdown = ROSHandler.shutdown
    asking = threading.Lock()  # a flood of calls causes one request to the master at a time
    unasked = threading.Event()  # a call arrived since the last request
    said = False

    def judged(handler: ROSHandler, caller: str, message: str = "") -> _Answer:
        nonlocal said
        unasked.set()
        if not asking.acquire(blocking=False):
            return _REFUSED
        try:
            while unasked.is_set():
                unasked.clear()
                if name_is_lost():
                    answer: _Answer = shutdown(handler, caller, message)
                    return answer
        finally:
            asking.release()
        if not said:
            said = True
            log.warning("a shutdown call of %s was refused (%s); more are not logged", caller, message)
        return _REFUSED

    ROSHandler.shutdown = judged
