"""Helpers for tests with other processes: wait for a condition, find free ports, serve, clean the environment."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from socketserver import BaseServer
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[1]
PATIENCE_S = 30.0


def until(condition: Callable[[], Any], what: str, timeout_s: float = PATIENCE_S) -> Any:
    """Poll until `condition` is true and return its value. Other processes send no event for this."""
    deadline = time.monotonic() + timeout_s
    while not (value := condition()):
        assert time.monotonic() < deadline, f"not within {timeout_s} s: {what}"
        time.sleep(0.01)
    return value


def free_port() -> int:
    """A TCP port that is free now."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


@contextmanager
def serving(server: BaseServer) -> Iterator[None]:
    """Serve in a thread for the length of a `with` block, then close the server."""
    with server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield
        finally:
            server.shutdown()
            thread.join()


def outside() -> dict[str, str]:
    """The environment of a person's shell, without variables of the tests."""
    foreign = ("FLEET_", "DJANGO_", "ROS_")
    return {name: value for name, value in os.environ.items() if not name.startswith(foreign)}


def end(process: Any, timeout_s: float = 5.0) -> int:
    """Terminate a process, kill it after `timeout_s`; return its exit code."""
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
    try:
        return process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()
