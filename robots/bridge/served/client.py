"""The bridge's client of a process that serves web processes itself, and runs only while one of them needs it.

The process names its address; the bridge passes it on to web processes (`robots.link.process_link`).
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from robots.bridge.robot_clock import RobotClock
from robots.bridge.server.link_server import Link
from robots.bridge.topics.line_process import LineProcess
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.robot_ros import Ros, side_command
from robots.shared.wire import ProcessAt, ProcessName, Refusal

SILENCE_S = 5.0  # a process without a sign of life for this time hangs: it is killed, and another one starts
START_S = 30.0  # a new process names its address within this time, or is killed
LINGER_S = 30.0  # until an unused process ends: a page that opens earlier has a picture sooner

_process_at = msgspec.json.Decoder(ProcessAt)


class Served(NamedTuple):
    """A kind of process. `ended`, `hung`: what people read when it does."""

    name: ProcessName
    ended: Refusal
    hung: Refusal
    has_sides: bool = True  # it reads topics

    def command(self, ros: Ros) -> Sequence[str]:
        """Return the command that starts it for a robot."""
        if self.has_sides:
            return side_command(ros, self.name)
        return sys.executable, "-m", f"robots.bridge.recorder.{self.name}"


CAMERA = Served(
    "camera",
    Refusal("camera_ended", "The camera’s process ended by itself. It is started again.", "robot"),
    Refusal("camera_hung", "The camera’s process hung. It is started again.", "robot"),
)
TAP = Served(
    "tap",
    Refusal("tap_ended", "The process that reads topics ended by itself. It is started again.", "robot"),
    Refusal("tap_hung", "The process that reads topics hung. It is started again.", "robot"),
)
SHELF = Served(
    "shelf",
    Refusal(
        "shelf_ended", "The process that reads recordings ended by itself. It is started again.", "robot"
    ),
    Refusal("shelf_hung", "The process that reads recordings hung. It is started again.", "robot"),
    has_sides=False,
)


class ProcessClient:
    """One such process of one robot. Lives on the event loop."""

    def __init__(
        self,
        config: BridgeConfig,
        served: Served,
        command: Sequence[str] = (),
        linger_s: float = LINGER_S,
    ) -> None:
        self._served = served
        self._child = LineProcess(command or served.command(config.ros), msgspec.json.encode(config), self)
        self.clock = RobotClock()
        self._linger_s = linger_s
        self._watchers: set[Link] = set()  # links of web processes that need the process
        self._at = self._nowhere()
        self._idle: asyncio.TimerHandle | None = None
        self._silence: asyncio.TimerHandle | None = None  # ends a process that hangs
        self._hung = False

    async def close(self) -> None:
        """End the process: the bridge ends."""
        if self._idle is not None:
            self._idle.cancel()
        await self._child.close()

    def set_wanted(self, watcher: Link, wanted: bool) -> None:
        """Start the process for this watcher, or note that the watcher no longer needs it."""
        if not wanted:
            self.forget(watcher)
            return
        self._watchers.add(watcher)
        self._stay()
        self._child.need()
        watcher.report(self._at)

    def forget(self, watcher: Link) -> None:
        """Forget a watcher; the process ends a while after the last watcher left."""
        if watcher not in self._watchers:
            return  # the end of a link that does not watch must not keep a process that is ending
        self._watchers.discard(watcher)
        if not self._watchers and self._at.refusal is not None:
            self._at = self._nowhere()  # the next watcher must not get an old refusal
        if not self._watchers and self._idle is None and self._child.lives:
            self._idle = asyncio.get_running_loop().call_later(self._linger_s, self._end)

    def _stay(self) -> None:
        if self._idle is not None:
            self._idle.cancel()
            self._idle = None

    def _end(self) -> None:
        self._idle = None
        self._child.close_input()

    # --- the process (line_process.LineProcessOwner) ----------------------------------------------

    def needed(self) -> bool:
        """Return whether to keep the process."""
        return bool(self._watchers or self._idle)

    def began(self) -> None:
        """Wait for the address of the new process. Its last watcher may have left while it started."""
        self._hung = False
        self._await_life(START_S)
        if not self._watchers and self._idle is None:
            self._idle = asyncio.get_running_loop().call_later(self._linger_s, self._end)

    def handle_line(self, line: bytes) -> None:
        """Take the address on which the process listens. The process repeats it as a sign of life."""
        at = _process_at.decode(line)
        self._await_life(SILENCE_S)
        self._child.send(msgspec.json.encode(self.clock))
        if at != self._at:
            self._move(at)

    def ended(self) -> None:
        """Note that the process no longer listens, and report the reason to the watchers."""
        if self._silence is not None:
            self._silence.cancel()
        why = self._served.hung if self._hung else self._served.ended
        self._move(self._nowhere(why if self._watchers else None))

    def _nowhere(self, why: Refusal | None = None) -> ProcessAt:
        return ProcessAt(self._served.name, refusal=why)

    def _await_life(self, within_s: float) -> None:
        if self._silence is not None:
            self._silence.cancel()
        loop = asyncio.get_running_loop()
        self._silence = loop.call_later(within_s, self._hang)

    def _hang(self) -> None:
        self._hung = True
        self._child.kill("it shows no sign of life")

    def _move(self, at: ProcessAt) -> None:
        self._at = at
        for watcher in self._watchers:
            watcher.report(at)
