"""The pages process is started again after any failure to start."""

import threading

from fleet.server.pages import process as pages_process


class Started:
    """A process that runs until the test ends."""

    def __init__(self, over):
        self._over = over

    def wait(self):
        self._over.wait()
        return 0


def test_a_process_that_cannot_be_started_is_tried_again(tmp_path, monkeypatch):
    tries, started, over = [], threading.Event(), threading.Event()

    def popen(*_, **__):
        tries.append(1)
        if len(tries) < 3:
            raise BlockingIOError(11, "Resource temporarily unavailable")  # from fork
        started.set()
        return Started(over)

    monkeypatch.setattr(pages_process, "AGAIN_S", 0.0)
    monkeypatch.setattr(pages_process.subprocess, "Popen", popen)
    keeper = pages_process.Keeper(tmp_path, "fleet.site.asgi:application")
    try:
        assert started.wait(10)
    finally:
        keeper.end()
        over.set()
