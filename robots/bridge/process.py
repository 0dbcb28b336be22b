"""The bridge process: wires the core to its link, to ROS, to the state file and to the clock."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
import os
import signal
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from msgspec import Struct

from robots import wire
from robots.bridge.config import BridgeConfig
from robots.bridge.core import Core
from robots.bridge.drives import DriveLog
from robots.bridge.gate.gate import Gate
from robots.bridge.link import Link, LinkServer
from robots.bridge.ros.node import RosBase
from robots.bridge.sink import RecordSink
from robots.bridge.store import AlreadyRunning, Store

log = logging.getLogger(__name__)

TICK_S = 0.05
_VIEW_GAP_S = 0.05  # while somebody looks, a view with each scan, but not more often than this
_VIEW_LATEST_S = 0.15  # without scans too
_STATUS_TICKS = 10  # a status every 0.5 s in any case
_REFUSAL_GAP_S = 0.25  # refused drive messages of one code are answered this often

EXIT_ALREADY_RUNNING = 3


class Bridge:
    """Everything of one bridge process."""

    def __init__(self, config: BridgeConfig, sink: RecordSink, store: Store) -> None:
        left = store.load(config.last_fence)
        self._store = store
        self._fence_on_disk = left.fence
        self._disk = ThreadPoolExecutor(1, thread_name_prefix="state-file")
        self._base = RosBase(config)
        self._drives = DriveLog(sink)
        gate = Gate(config.gate)
        self._core = Core(config, self._base, gate, self._drives, left, self._announce)
        self._links = LinkServer(config.link, self._opened, self._received, self._closed)
        self._ended = asyncio.Event()
        self._answered: dict[str, float] = {}
        self._last_key: tuple[object, ...] = ()
        self._viewed_s = float("-inf")
        self._core.on_scan = lambda: self._view(_VIEW_GAP_S)

    async def run(self) -> None:
        """Until the supervisor goes or a signal comes; leaves the robot at zero."""
        self._watch_for_the_end()
        await self._links.start()
        self._base.start(asyncio.get_running_loop(), self._core)
        gc.collect()
        gc.freeze()  # what is loaded stays: keeps the collector's pauses short
        try:
            await self._tick_until_ended()
        finally:
            self._base.stop()
            now_s = time.monotonic()
            await asyncio.to_thread(self._drives.close, now_s)
            await self._links.close()
            self._disk.shutdown(wait=True)

    # --- the clock ---------------------------------------------------------------------------------

    async def _tick_until_ended(self) -> None:
        count = 0
        due_s = time.monotonic()
        while not self._ended.is_set():
            now_s = time.monotonic()
            self._core.tick(now_s)
            self._show(now_s, count)
            count += 1
            due_s = max(due_s + TICK_S, now_s)  # after a stall: on from here, no catching up
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._ended.wait(), due_s + TICK_S - time.monotonic())

    def _show(self, now_s: float, count: int) -> None:
        self._view(_VIEW_LATEST_S)
        watchers = self._watchers()
        state = self._core.state(now_s, watchers)
        key = (state.phase, state.text, state.stop, state.fence, state.neutral_needed, tuple(watchers))
        if key != self._last_key or count % _STATUS_TICKS == 0:
            self._last_key = key
            self._announce(wire.Status(state))

    def _view(self, gap_s: float) -> None:
        """Show the robot to who looks, unless the last picture is younger than `gap_s`."""
        now_s = time.monotonic()
        looked_at = [link for link in self._links.links if link.watchers]
        if not looked_at or now_s - self._viewed_s < gap_s:
            return
        self._viewed_s = now_s
        view = wire.encode(wire.View(self._core.state(now_s, self._watchers()), self._core.scan(now_s)))
        for link in looked_at:
            link.show(view)

    def _watchers(self) -> list[str]:
        return sorted({name for link in self._links.links for name in link.watchers})

    # --- the link ----------------------------------------------------------------------------------

    def _opened(self, link: Link) -> None:
        link.report(self._core.hello(time.monotonic()))

    def _closed(self, link: Link) -> None:
        self._core.link_lost(link.number, time.monotonic())

    async def _received(self, link: Link, raw: bytes) -> None:
        now_s = time.monotonic()
        try:
            message = wire.link_request(raw)
        except wire.WireError as error:
            self._core.refused[error.refusal.code] += 1
            self._refuse(link, wire.Refused("link", error.refusal), now_s)
            return
        match message:
            case wire.Drive():
                refusal = self._core.drive(message, link.number, now_s)
                if refusal is not None:
                    refused = wire.Refused("drive", refusal, message.seq, message.fence)
                    self._refuse(link, refused, now_s)
            case wire.Grant():
                await self._grant(link, message)
            case wire.Revoke():
                self._core.revoke(message.fence, message.reason, now_s)
            case wire.Hold():
                self._core.hold(message.fence, message.reason, now_s)
            case wire.LinkStop():
                self._core.stop(message.by, message.reason, now_s)
                self._persist()
                self._answer_latch(link)
            case wire.LinkClear():
                self._core.clear(now_s)
                self._persist()
                self._answer_latch(link)
            case wire.Watch():
                link.watchers = message.watchers
            case wire.LinkHello():
                self._greet(link, message)

    def _greet(self, link: Link, hello: wire.LinkHello) -> None:
        link.name = hello.web
        if hello.protocol != wire.PROTOCOL:
            text = f"The web process speaks protocol {hello.protocol}, this bridge {wire.PROTOCOL}: restart both."
            link.report(wire.Refused("link_hello", wire.Refusal("protocol", text, "wire")))

    async def _grant(self, link: Link, grant: wire.Grant) -> None:
        """A new fencing number is on disk before it is in force: nothing older counts after a kill."""
        grants = self._core.grants
        refusal = grants.check(grant)
        if refusal is None and grant.fence > self._fence_on_disk:
            grants.highest = grant.fence
            refusal = await self._persist_fence() or grants.check(grant)
        if refusal is not None:
            link.report(wire.Refused("grant", refusal, fence=grant.fence))
            return
        self._core.grant(grant, link.number, time.monotonic())
        link.report(wire.Granted(grant.fence))

    async def _persist_fence(self) -> wire.Refusal | None:
        state = self._core.persisted()
        try:
            await asyncio.get_running_loop().run_in_executor(self._disk, self._store.save, state)
        except OSError as error:
            text = f"The bridge cannot write its state file ({error.strerror}): control is not given."
            return wire.Refusal("state_not_saved", text, "lease")
        self._fence_on_disk = state.fence
        return None

    def _persist(self) -> None:
        """Write the latch in the background: the robot has been told already."""
        self._disk.submit(self._store.save, self._core.persisted()).add_done_callback(_log_failure)

    def _answer_latch(self, link: Link) -> None:
        link.report(wire.Stopped(self._core.stop_state))

    def _refuse(self, link: Link, refused: wire.Refused, now_s: float) -> None:
        """Answer, but not thirty times a second."""
        code = refused.refusal.code
        if now_s - self._answered.get(code, float("-inf")) >= _REFUSAL_GAP_S:
            self._answered[code] = now_s
            link.report(refused)

    def _announce(self, message: Struct) -> None:
        for link in self._links.links:
            link.report(message)

    # --- the end -----------------------------------------------------------------------------------

    def _watch_for_the_end(self) -> None:
        """SIGTERM and SIGINT end the process; so does the end of stdin, which the supervisor holds open."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, self._ended.set)
        lifeline = sys.stdin.fileno()
        os.set_blocking(lifeline, False)
        loop.add_reader(lifeline, self._lifeline, lifeline)

    def _lifeline(self, lifeline: int) -> None:
        with contextlib.suppress(BlockingIOError):
            if os.read(lifeline, 1024):
                return
            log.info("the supervisor is gone: stopping")
            asyncio.get_running_loop().remove_reader(lifeline)
            self._ended.set()


def _log_failure(saved: Future[None]) -> None:
    error = saved.exception()
    if error is not None:
        log.error("the state file was not written: %s", error)


def run(config: BridgeConfig, sink: RecordSink) -> int:
    """Be the bridge of one robot; returns the exit code."""
    store = Store(Path(config.state_dir), config.robot_id)
    try:
        store.lock()
    except AlreadyRunning as error:
        log.error("%s", error)
        return EXIT_ALREADY_RUNNING
    sys.setswitchinterval(0.001)  # the control loop waits less for rospy's threads
    try:
        asyncio.run(Bridge(config, sink, store).run())
    finally:
        store.unlock()
    return 0
