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
    """Return an event that SIGTERM, SIGINT or the end of the file `life_line` sets; `life_line` closes with the parent.

    The process exits `patience_s` later, finished or not. Call it from the main thread.
    """
    # Not a handler that sets the event: it would run in the main thread, and if that is just about to wait for the
    # event, it would wait for a lock that it holds itself. Instead, Python writes a byte to this pipe, in C.
    hears, tells = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
    signal.set_wakeup_fd(tells, warn_on_full_buffer=False)
    for number in SIGNALS:
        signal.signal(number, lambda *_: None)
    asked_to_end = threading.Event()
    threading.Thread(
        target=_listen, args=(asked_to_end, hears, life_line, patience_s), name="the end", daemon=True
    ).start()
    return asked_to_end


# Exit codes of a bridge.
EXIT_ALREADY_RUNNING = 3  # it found another one on this computer
EXIT_NAME_LOST = 4  # on the robot's master, to another node; a fresh process joins, or refuses in words
EXIT_NOT_JOINED = 5  # a step failed that rospy does only once in a process


def exit_within(patience_s: float) -> None:
    """Exit this process by then, finished or not: a master or database that hangs must not keep it running."""
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
