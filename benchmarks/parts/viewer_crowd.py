"""Start a crowd of viewers, and collect the views that they received."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Sequence

from script.stack.places import REPOSITORY
from script.stack.stack import Stack

READY_S = 60.0


class Crowd:
    """Async context: `count` viewers of `slug`. `seen`: view's checksum -> viewer's number -> arrival in seconds.

    With several cookies, these people open the pages in turn. With `camera`, the viewers watch that camera,
    and `seen` has the pictures' numbers in place of checksums. With `topic` they are clients of the rosbridge door with
    tokens (`Bearer ...`) that subscribe to this topic, and `seen` has the messages' stamps (ns).
    """

    def __init__(
        self,
        stack: Stack,
        slug: str,
        cookie: str | Sequence[str],
        count: int,
        *,
        camera: str | None = None,
        topic: str | None = None,
        one_stalls: bool = False,
    ) -> None:
        self._stack = stack
        self._slug = slug
        self._cookies = [cookie] if isinstance(cookie, str) else cookie
        self._count = count
        self._camera = camera
        self._topic = topic
        self._one_stalls = one_stalls
        self.seen: dict[int, dict[int, float]] = defaultdict(dict)

    async def __aenter__(self) -> Crowd:
        stack = self._stack
        words = [stack.hosts[0], str(stack.port), self._slug, stack.url, str(self._count)]
        if self._camera:
            words += ["--camera", self._camera]
        if self._topic:
            words += ["--topic", self._topic]
        if self._one_stalls:
            words.append("--stall")
        self._process = await asyncio.create_subprocess_exec(
            *("/usr/bin/setpriv", "--pdeathsig", "KILL"),
            *(sys.executable, "-m", "benchmarks.parts.crowd", *words),
            cwd=REPOSITORY,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._process.stdin and self._process.stdout  # noqa: S101 - we asked for pipes
        self._process.stdin.write(("\t".join(self._cookies) + "\n").encode())
        await asyncio.wait_for(self._opened(self._process.stdout), READY_S)
        self._reader = asyncio.create_task(self._read(self._process.stdout))
        return self

    async def __aexit__(self, *_: object) -> None:
        self._process.kill()
        await self._process.wait()
        await self._reader

    @property
    def pid(self) -> int:
        """Return the process id of the viewers."""
        return self._process.pid

    async def watch(self, *, on: bool) -> None:
        """Begin or end watching the camera or topic, on all viewers."""
        assert self._process.stdin  # noqa: S101 - we asked for a pipe
        self._process.stdin.write(b"watch\n" if on else b"end\n")
        await self._process.stdin.drain()

    async def until_all_see(self) -> None:
        """Wait until each viewer that reads has received a view or picture."""

        def viewers() -> set[int]:
            return {viewer for arrivals in self.seen.values() for viewer in arrivals}

        await self.until(lambda: len(viewers()) == self._count - self._one_stalls)

    async def until(self, condition: Callable[[], object]) -> None:
        """Wait until `condition()` is true, which is checked from time to time."""
        end_s = time.monotonic() + READY_S
        while not condition():
            if time.monotonic() > end_s:
                raise TimeoutError("The viewers waited in vain.")
            await asyncio.sleep(0.05)

    async def _opened(self, lines: asyncio.StreamReader) -> None:
        while await lines.readline() != b"ready\n":
            if self._process.returncode is not None:
                raise RuntimeError("The viewers could not be opened.")

    async def _read(self, lines: asyncio.StreamReader) -> None:
        async for line in lines:
            number, at_ns, checksum = map(int, line.split())
            self.seen[checksum][number] = at_ns / 1e9
