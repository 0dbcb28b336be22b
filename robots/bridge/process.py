"""The bridge process: connects the core to links, ROS, state file, watchdog and clock."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any
from uuid import UUID

from msgspec import Struct, structs

from robots.bridge import state_view
from robots.bridge.audit.records import Records
from robots.bridge.core import Core
from robots.bridge.drive.drive_log import DriveLog
from robots.bridge.gate.gate import Gate
from robots.bridge.lease.lease_orders import LeaseOrders
from robots.bridge.lease.state_store import AlreadyRunning, SavedState, StateStore
from robots.bridge.link_handler import LinkHandler
from robots.bridge.maps.map_fetch import MapFetcher
from robots.bridge.recorder.erasing.file_cuts import FileCuts
from robots.bridge.recorder.files.file_changes import FileChanges
from robots.bridge.recorder.recorder_client import RecorderClient
from robots.bridge.robot.sides import side
from robots.bridge.served.client import CAMERA, SHELF, TAP, ProcessClient
from robots.bridge.server.link_server import LinkServer
from robots.bridge.topics.inspector_client import InspectorClient
from robots.bridge.watchdog.client import WatchdogClient
from robots.bridge.watchdog.rules import Heartbeat, StopPress
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.configuration.watchdog_config import lane_path
from robots.shared.link.pending_stops import PendingStops, WaitingStop, name_of
from robots.shared.maps.goal_map import GoalMap
from robots.shared.processes import last_words
from robots.shared.processes.memory import end_without_memory, lift_limit, limit_memory
from robots.shared.processes.scheduling import Garbage, ask_for_priority
from robots.shared.processes.shutdown import (
    EXIT_ALREADY_RUNNING,
    EXIT_NAME_LOST,
    EXIT_NOT_JOINED,
    exit_within,
)
from robots.shared.records.record_sink import RecordSink, TakenMap

log = logging.getLogger(__name__)

# Memory limit: the bridge needs a fifth of it; the inspector has its own limit.
MOST_BYTES = 768 * 1024 * 1024
TICK_S = 0.05
# Between ticks while nothing is sent to the base, and somebody looks; nobody looks
WATCHED_S, REST_S = 0.1, 0.2
# While somebody has control and the robot rests: between ticks; between looks into the mailboxes. Zeros and heartbeats
# still come every `TICK_S`
HELD_S, HELD_MAIL_S = 0.2, 0.1
SENT_S = 0.002  # after the begin of a drive was asked for: its request is on its way to the records process
_VIEW_GAP_S = 0.05  # while a page watches: a view with each scan, at most this often
_VIEW_LATEST_S = 0.15  # and at least this often, also without scans
PATH_GAP_S = 1.0
_STATUS_S = 0.5 - TICK_S / 2.0  # a status at least every 0.5 s
END_S = 4.0  # time limit of the end, even if database or disk hang


class Bridge:
    """All parts of one bridge process."""

    def __init__(self, config: BridgeConfig, sink: RecordSink, store: StateStore) -> None:
        saved, presses = initial_state(_pending_stops(config), store.load(config.last_fence))
        self._socket = config.link.unix_path
        self._base = side(config)
        self._records = Records(sink)
        self._gate = Gate(config.gate)
        self._sonars = config.topics.sonars
        # Stop numbers start from the time of day: a page that saw a stop of an earlier process must not clear a new
        # one.
        stops_before = time.time_ns() // 1_000_000
        self._inspector = InspectorClient(
            config, lambda: self._core.tasks.publications.inspector_ended(time.monotonic())
        )
        self._served = {served.name: ProcessClient(config, served) for served in (CAMERA, TAP, SHELF)}
        self._recorder = RecorderClient(config, self._records)
        self._file_changes = FileChanges(config, self._records)
        self._file_cuts = FileCuts(config, self._records)
        self._core = Core(
            config,
            self._base,
            self._gate,
            self._records,
            DriveLog(self._records, self._base.map_to_odom),
            saved,
            self._announce,
            self._inspector,
            stops_before,
            on_scan=lambda: self._soon(self._view_scan),
            on_news=lambda: self._soon(self._prepare),
            on_wake=lambda: asyncio.get_running_loop().call_later(SENT_S, self._soon, self._core.catch_up),
            recorded=self._recorder.state,
        )
        self._core.latch.ignore(presses)
        self._maps = MapFetcher(
            config,
            self._keep_map,
            gone=lambda why: self._core.tasks.navigation.unmapped(why, time.monotonic()),
        )
        self._lease_orders = LeaseOrders(self._core, store, saved.fence, self._changed)
        handler = LinkHandler(self._core, self._lease_orders, self._inspector, self._served, self._recorder)
        self._links = LinkServer(
            config.link, handler.opened, handler.received, handler.closed, handler.handle
        )
        self._watchdog = WatchdogClient(
            lane_path(config),
            self._pressed,
            lambda silent_s: self._core.cancelled_by_watchdog(silent_s, time.monotonic()),
        )
        self._goal = saved.goal  # navigation's goal in the state file
        self._ended = False
        self._rests = False
        self._ticked_s = self._mail_s = float("-inf")
        self._wake = asyncio.Event()
        self._exit_code = 0
        self._last_news: tuple[object, ...] = ()
        self._viewed_s = self._reported_s = float("-inf")
        self._path, self._path_s = wire.GoPath([]), float("-inf")
        self._due: set[Callable[[], None]] = set()

    async def run(self) -> int:
        """Run until the supervisor ends or a signal comes; leave the robot at zero. Return the exit code."""
        self._watch_for_the_end()
        await self._links.start()
        loop = asyncio.get_running_loop()
        # Latch stops that only the watchdog received, before the robot is joined.
        self._beat(time.monotonic())
        self._records.open(lambda: loop.call_soon_threadsafe(self._recorded), time.monotonic())
        self._base.start(loop, self._core, self._after_commands, self._node_lost)
        self._garbage = Garbage()
        ask_for_priority()
        leftovers = loop.create_task(self._recorder.begin())
        try:
            await self._tick_until_ended()
        finally:
            lift_limit()
            self._ended = True
            exit_within(END_S)
            self._links.shut()  # nobody may drive while the bridge ends
            self._leave_at_zero(time.monotonic())
            self._watchdog.close()
            leftovers.cancel()
            self._file_cuts.close()
            await self._maps.close()
            await asyncio.gather(
                self._inspector.close(),
                self._recorder.close(),
                *(process.close() for process in self._served.values()),
                asyncio.to_thread(self._records.close),  # then no record calls the loop any more
            )
            await self._links.close()
            self._lease_orders.close()
        return self._exit_code

    # --- one piece of work at a time --------------------------------------------------------------

    def _soon(self, piece: Callable[[], None]) -> None:
        """Run this piece of work once, in its own turn of the loop."""
        if piece not in self._due:
            self._due.add(piece)
            asyncio.get_running_loop().call_soon(self._do_due, piece)

    def _do_due(self, piece: Callable[[], None]) -> None:
        self._due.discard(piece)
        self._after_commands(piece)

    def _after_commands(self, piece: Callable[[], None]) -> None:
        """Handle waiting commands and the watchdog's messages first: they wait for one piece of work at most."""
        try:
            self._watchdog.read()
            self._links.read_lanes()
        finally:  # run the piece in any case: without it, its source would never be read again
            piece()

    def _prepare(self) -> None:
        self._gate.prepare(time.monotonic())

    def _view_scan(self) -> None:
        self._view(_VIEW_GAP_S)

    # --- the clock ---------------------------------------------------------------------------------

    async def _tick_until_ended(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = time.monotonic()
        while not self._ended:
            # read sensors and commands before the dead-man is checked: they wait after a stall
            if self._is_due(self._mail_s, HELD_MAIL_S):
                self._mail_s = time.monotonic()
                self._soon(self._base.mail.take_waiting)
                await asyncio.sleep(0.0)
            now_s = time.monotonic()
            if self._is_due(self._ticked_s, HELD_S):
                self._ticked_s = now_s
                self._tick(now_s, now_s - due_s)
            else:
                self._core.repeat_zero(now_s, now_s - due_s)
            self._beat(now_s)
            self._rests = self._may_rest(now_s)
            # after a stall, do not repeat the missed ticks
            rest_s = WATCHED_S if self._base.watched else REST_S
            due_s = max(due_s, now_s - TICK_S) + (rest_s if self._rests else TICK_S)
            alarm = loop.call_at(due_s, self._wake.set)
            await self._wake.wait()
            self._wake.clear()
            alarm.cancel()
            due_s = min(due_s, time.monotonic())  # a change wakes it earlier

    def _is_due(self, last_s: float, held_s: float) -> bool:
        """Return whether periodic work is due: at each turn, but every `held_s` while the robot rests under control."""
        return not self._core.rests or time.monotonic() - last_s >= held_s - TICK_S / 2.0

    def _may_rest(self, now_s: float) -> bool:
        """Return whether ticks may be seldom: nothing is sent to the base, and nothing drives it."""
        core = self._core
        return not (core.in_use or core.publishing(now_s) or core.drives_itself)

    def _changed(self) -> None:
        """Tell the watchdog at once that control or the stop changed, and end the rest."""
        now_s = time.monotonic()
        self._beat(now_s)
        self._base.hurry(self._core.in_use)
        if self._rests and not self._may_rest(now_s):
            self._rests = False
            self._wake.set()

    def _tick(self, now_s: float, late_s: float) -> None:
        self._core.tick(now_s, late_s)
        if (goal := self._core.tasks.navigation.may_drive_to) != self._goal:
            self._goal = goal
            self._lease_orders.save_latch()
        grant = self._core.lease.current
        self._base.hurry(self._core.in_use)
        self._base.watched = self._recorder.wants_view or any(link.watchers for link in self._links.links)
        self._base.use_on_demand_topics(grant is not None)
        self._maps.tick(
            grant.fence if grant else None,
            now_s,
            self._core.tasks.navigation.driving_requester is not None,
            self._core.tasks.navigation.map_run,
        )
        self._recorder.tick(grant, now_s)
        self._file_changes.tick(now_s)
        self._file_cuts.tick(now_s)
        self._soon(self._show)
        self._soon(self._collect)

    def _beat(self, now_s: float) -> None:
        """Send the watchdog a heartbeat with the bridge's state."""
        stop = self._core.stop_state
        beat = Heartbeat(
            publishing=self._core.publishing(now_s),
            listened=self._base.listeners > 0,
            latched=stop.state != "clear",
            by=stop.by or "",
            reason=stop.reason,
            drive=self._core.tasks.routing.topic("drive"),
            drives_itself=self._core.drives_itself,
            moves_although_stopped=self._core.moves_although_stopped(now_s),
        )
        self._watchdog.beat(beat, now_s)
        self._core.watchdog_missing = self._watchdog.missing(now_s)

    def _pressed(self, press: StopPress) -> None:
        """Latch a stop that the watchdog received. The watchdog keeps it until it is on disk."""
        self._core.stop_from_watchdog(press.by, press.reason, press.press, time.monotonic(), press.at_s)
        loop = asyncio.get_running_loop()

        def written(_saved: Future[None]) -> None:
            with contextlib.suppress(RuntimeError):  # the bridge has ended
                loop.call_soon_threadsafe(self._watchdog.heard, press.number)

        self._lease_orders.save_latch().add_done_callback(written)

    def _recorded(self) -> None:
        if not self._ended:
            self._core.recorded(time.monotonic())

    def _keep_map(self, taken: TakenMap) -> None:
        self._records.keep_map(taken)
        self._core.tasks.navigation.mapped(GoalMap(taken), time.monotonic())

    def _collect(self) -> None:
        self._garbage.collect(time.monotonic(), waits=self._core.lease.current is not None)

    def _show(self) -> None:
        now_s = time.monotonic()
        for process in self._served.values():
            process.clock = self._core.robot_clock
        self._inspector.follow_clock(self._core.robot_clock)
        self._view(_VIEW_LATEST_S)
        self._show_path(now_s)
        watchers, more = self._watchers()
        news = (*self._core.headline(now_s), *watchers, more)
        if news != self._last_news or now_s - self._reported_s >= _STATUS_S:
            self._last_news, self._reported_s = news, now_s
            state = self._core.state(now_s, watchers, more)
            self._announce(wire.Status(state))
            self._recorder.observe(state, self._core.held, now_s)

    def _show_path(self, now_s: float) -> None:
        """Send navigation's path to all links when it has changed."""
        path = self._core.tasks.navigation.shown_path
        if path != self._path and now_s - self._path_s >= PATH_GAP_S:
            self._path, self._path_s = path, now_s
            self._announce(path)

    def _view(self, gap_s: float) -> None:
        """Send a view to links with watchers, unless the last one is younger than `gap_s`."""
        now_s = time.monotonic()
        looked_at = [link for link in self._links.links if link.watchers]
        records = self._recorder.wants_view
        if not (looked_at or records) or now_s - self._viewed_s < gap_s:
            return
        self._viewed_s = now_s
        draws = any(link.joints_wanted for link in looked_at)
        scan = state_view.scan(self._gate, self._sonars, now_s, with_heights=draws)
        joints = self._base.joints(now_s) if draws or records else {}
        view = wire.View(self._core.state(now_s, *self._watchers()), scan, joints)
        if looked_at:
            shown = wire.encode_report(view if draws else structs.replace(view, joints={}))
            for link in looked_at:
                link.show(shown)
        if records:
            self._recorder.view(view, self._core.held, now_s)

    def _watchers(self) -> tuple[list[str], int]:
        """Return the names of watchers, and the number of further watchers."""
        links = self._links.links
        return sorted({name for link in links for name in link.watchers}), sum(
            link.watchers_more for link in links
        )

    def _announce(self, message: Struct) -> None:
        for link in self._links.links:
            if link.greeted:
                link.report(message)

    # --- the end -----------------------------------------------------------------------------------

    def _watch_for_the_end(self) -> None:
        """End on SIGTERM, on SIGINT, and when stdin closes: the supervisor holds it open while it runs."""
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(self._failed)
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, self._end)
        lifeline = sys.stdin.fileno()
        os.set_blocking(lifeline, False)
        loop.add_reader(lifeline, self._lifeline, lifeline)

    def _end(self) -> None:
        self._ended = True
        self._wake.set()

    def _leave_at_zero(self, now_s: float) -> None:
        """Leave the robot at zero, even if ending the tasks fails."""
        try:
            self._core.close(now_s)
        finally:
            self._base.stop()

    def _node_lost(self, name_taken: bool) -> None:
        self._exit_code = EXIT_NAME_LOST if name_taken else EXIT_NOT_JOINED
        if self._socket:
            last_words.write(self._socket, last_words.LAST, self._core.reports.ros.text)
        self._end()

    def _failed(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Log a failed callback; the others continue. Without memory, end the process."""
        if isinstance(context.get("exception"), MemoryError):
            end_without_memory()
        else:
            loop.default_exception_handler(context)

    def _lifeline(self, lifeline: int) -> None:
        with contextlib.suppress(BlockingIOError):
            if os.read(lifeline, 1024):
                return
            log.info("the supervisor ended: stopping")
            asyncio.get_running_loop().remove_reader(lifeline)
            self._end()


def _pending_stops(config: BridgeConfig) -> list[WaitingStop]:
    if config.run_dir is None:
        return []
    return PendingStops(Path(config.run_dir)).of(name_of(UUID(config.robot_id)))


def initial_state(pending: Sequence[WaitingStop], saved: SavedState) -> tuple[SavedState, list[UUID]]:
    """Return the initial state and the pending presses. If a stop is pending, the state is latched.

    So the robot is stopped before anybody can drive. The files of pending stops stay until the stops are
    delivered and confirmed.
    """
    if pending:
        saved = structs.replace(saved, latched=True, by=pending[-1].by, reason=pending[-1].reason)
    return saved, [stop.press for stop in pending]


def run(config: BridgeConfig, sink: RecordSink) -> int:
    """Run the bridge of one robot; return the exit code."""
    store = StateStore(Path(config.state_dir), config.robot_id)
    try:
        store.lock()
    except AlreadyRunning as error:
        log.error("%s", error)
        return EXIT_ALREADY_RUNNING
    limit_memory(MOST_BYTES)
    sys.setswitchinterval(0.001)  # s: the control loop waits for the ROS side's threads for a shorter time
    try:
        return asyncio.run(Bridge(config, sink, store).run())
    finally:
        store.unlock()
