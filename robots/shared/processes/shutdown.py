"""Orderly end of a process: it reacts to the end signal at any moment and exits in time, even if a part hangs."""

from __future__ import annotations

import logging
import os
import select
import signal
import threading
import time

log = logging.getLogger(__name__)

SIGNALS = (signal.SIGTERM, signal.SIGINT)


def end_event(life_line: int | None, patience_s: float) -> threading.Event:
    """Return an event that is set by SIGTERM, by SIGINT, or when the file `life_line` ends because the parent ended.

    The process exits `patience_s` later, even if it is not finished. Call this from the main thread.
    """
    # A signal handler must not set the event: it runs in the main thread, and this thread may hold the event's lock,
    # because it is about to wait for the event. Then it would wait for itself. Instead, Python writes a byte to this
    # pipe, in C.
    read_end, write_end = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
    signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    for number in SIGNALS:
        signal.signal(number, lambda *_: None)
    asked_to_end = threading.Event()
    threading.Thread(
        target=_listen, args=(asked_to_end, read_end, life_line, patience_s), name="the end", daemon=True
    ).start()
    return asked_to_end


# Exit codes of a bridge.
EXIT_ALREADY_RUNNING = 3  # another bridge of this robot runs on this computer
EXIT_NAME_LOST = 4  # another node took the bridge's name on the robot's master; a new process joins again
EXIT_NOT_JOINED = 5  # a step failed that rospy can do only once in a process


def exit_within(patience_s: float) -> None:
    """Exit this process after `patience_s`, even if a master or database hangs."""
    threading.Thread(target=_leave, args=(patience_s,), name="the end", daemon=True).start()


def _listen(asked_to_end: threading.Event, signals: int, life_line: int | None, patience_s: float) -> None:
    sources = [signals] if life_line is None else [signals, life_line]
    while True:
        ready, _, _ = select.select(sources, [], [])
        if signals in ready or not os.read(ready[0], 4096):
            break
    asked_to_end.set()
    _leave(patience_s)


def _leave(patience_s: float) -> None:
    time.sleep(patience_s)
    log.warning("This process was not done %g s after the signal to end, and exits now.", patience_s)
    os._exit(1)
