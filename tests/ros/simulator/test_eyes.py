"""The simulator's vision thread, and the end of its owner when it dies."""

from __future__ import annotations

import queue
import threading

from robots.simulator.ros.eyes import Eyes


def test_a_dead_thread_with_a_full_queue_holds_no_exit_up():
    eyes = Eyes.__new__(Eyes)  # without topics: this test needs only the thread and its queue
    eyes._moments = queue.Queue(maxsize=1)
    eyes._moments.put(None)
    eyes._thread = threading.Thread(target=lambda: None)
    eyes._thread.start()
    eyes._thread.join()
    closing = threading.Thread(target=eyes.close, daemon=True)
    closing.start()
    closing.join(timeout=10.0)
    assert not closing.is_alive()
