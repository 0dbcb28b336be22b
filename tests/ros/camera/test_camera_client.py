"""The bridge keeps one working camera process while somebody watches."""

from __future__ import annotations

import asyncio
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from robots.bridge.served.client import CAMERA, ProcessClient
from robots.shared.wire import ProcessAt
from tests.processes import PATIENCE_S
from tests.ros.bridge_support import tiago_config


class Watcher:
    """A web process whose people watch the camera."""

    def __init__(self) -> None:
        self._reports: asyncio.Queue[ProcessAt] = asyncio.Queue()

    def report(self, message: ProcessAt) -> None:
        self._reports.put_nowait(message)

    async def hears(self, *, address: bool) -> str | None:
        """Wait for a report with an address, or for one without; return the code of its refusal."""
        while True:
            at = await asyncio.wait_for(self._reports.get(), PATIENCE_S)
            if (at.unix_path is not None) == address:
                return at.refusal.code if at.refusal else None


def camera_process() -> psutil.Process:
    [found] = [
        child
        for child in psutil.Process().children(recursive=True)
        if "robots.bridge.ros.camera" in child.cmdline()
    ]
    return found


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGKILL, "camera_ended"), (signal.SIGSTOP, "camera_hung")],
    ids=("dies", "hangs"),
)
async def test_another_process_follows_one_that(number, code, rosmaster, tmp_path):
    config = tiago_config(rosmaster, tmp_path)
    Path(config.link.unix_path).parent.mkdir()
    client, watcher = ProcessClient(config, CAMERA), Watcher()
    client.set_wanted(watcher, wanted=True)
    await watcher.hears(address=True)
    first = camera_process()
    first.send_signal(number)
    assert await watcher.hears(address=False) == code
    await watcher.hears(address=True)
    assert camera_process() != first
    await client.close()


_ENDS_WHEN_TOLD = """
import pathlib, sys, time
starts, ending, may_end = map(pathlib.Path, sys.argv[1:])
with starts.open("a") as file:
    file.write("x")
print('{"t":"process_at","process":"camera","unix_path":"/nowhere"}', flush=True)
sys.stdin.read()
ending.touch()
while not may_end.exists():
    time.sleep(0.01)
"""


async def until(condition: Callable[[], bool], what: str) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, what
        await asyncio.sleep(0.01)


async def test_the_end_of_another_link_starts_no_further_process(rosmaster, tmp_path):
    starts, ending, may_end = (tmp_path / name for name in ("starts", "ending", "may_end"))
    command = (sys.executable, "-c", _ENDS_WHEN_TOLD, *map(str, (starts, ending, may_end)))
    client, watcher = (
        ProcessClient(tiago_config(rosmaster, tmp_path), CAMERA, command, linger_s=0.5),
        Watcher(),
    )
    client.set_wanted(watcher, wanted=True)
    await watcher.hears(address=True)
    client.set_wanted(watcher, wanted=False)
    await until(ending.exists, "the process is asked to end")
    client.forget(Watcher())  # a link that never watched
    may_end.touch()
    await until(lambda: asyncio.all_tasks() == {asyncio.current_task()}, "the client rests")
    assert starts.read_text() == "x"
    await client.close()
