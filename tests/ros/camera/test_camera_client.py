"""The bridge keeps one working camera process while somebody watches."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path

import psutil
import pytest

from robots.bridge.camera.camera_client import CameraClient
from robots.wire import CameraAt
from tests.processes import PATIENCE_S
from tests.ros.bridge_support import tiago_config


class Watcher:
    """A web process with people who watch."""

    def __init__(self) -> None:
        self._reports: asyncio.Queue[CameraAt] = asyncio.Queue()

    def report(self, message: CameraAt) -> None:
        self._reports.put_nowait(message)

    async def hears(self, *, address: bool) -> str | None:
        """Wait until it hears an address, or that there is none; return the code of the reason."""
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
    client, watcher = CameraClient(config), Watcher()
    client.set_wanted(watcher, wanted=True)
    await watcher.hears(address=True)
    first = camera_process()
    first.send_signal(number)
    assert await watcher.hears(address=False) == code
    await watcher.hears(address=True)
    assert camera_process() != first
    await client.close()
