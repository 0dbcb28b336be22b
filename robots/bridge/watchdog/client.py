"""The bridge's end of the watchdog's socket: sends heartbeats, receives stops, never blocks the event loop."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable

import msgspec
from msgspec import structs

from robots.bridge.watchdog.rules import GoalsCancelled, Heartbeat, StopPress
from robots.bridge.watchdog.socket import LARGEST
from robots.shared import wire

log = logging.getLogger(__name__)

MISSING_S = 5.0  # s: a watchdog that ended is back within about one second

_decoder: msgspec.json.Decoder[StopPress | GoalsCancelled] = msgspec.json.Decoder(StopPress | GoalsCancelled)


class WatchdogClient:
    """Connects whenever a watchdog runs. `on_press` is called once for each stop of the watchdog.

    `on_cancel` is called with the time (s) for which this process was silent, when the watchdog cancelled its goals.
    """

    def __init__(
        self, path: str, on_press: Callable[[StopPress], None], on_cancel: Callable[[float], None]
    ) -> None:
        self._path = path
        self._on_press = on_press
        self._on_cancel = on_cancel
        self._socket: socket.socket | None = None
        self._handed_on = 0  # number of the last press passed to `on_press`
        self._heard = 0  # number of the last press written to the state file
        self._missed = False  # the missing watchdog was logged
        self._taken_s = float("-inf")  # time of the last accepted heartbeat
        self._since_s = float("inf")  # time of the first heartbeat sent

    def missing(self, now_s: float) -> bool:
        """Return whether no watchdog took a heartbeat for `MISSING_S`: none runs, or it is frozen."""
        return now_s - max(self._taken_s, self._since_s) > MISSING_S

    def beat(self, beat: Heartbeat, now_s: float) -> None:
        """Send the bridge's present state."""
        if not beat.latched:  # the stops so far were cleared, even if the disk has not taken them yet
            self._heard = self._handed_on
        self._since_s = min(self._since_s, now_s)
        if self._socket is None:
            self._connect()
        if self._socket is None:
            return
        try:
            self._socket.send(wire.encode(structs.replace(beat, heard=self._heard)), socket.MSG_NOSIGNAL)
            self._taken_s = now_s
        except BlockingIOError:  # the watchdog is frozen
            pass
        except OSError:
            self._lost()

    def heard(self, number: int) -> None:
        """Note that the stop of this number is latched here and written to disk."""
        self._heard = number

    def close(self) -> None:
        """Close the connection: the bridge ends."""
        if self._socket is not None:
            asyncio.get_running_loop().remove_reader(self._socket)
            self._socket.close()
            self._socket = None

    def _connect(self) -> None:
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        connection.setblocking(False)
        try:
            connection.connect(self._path)
        except OSError as error:
            connection.close()
            if not self._missed:
                self._missed = True
                log.warning("no watchdog runs (%s): a stop depends on this process alone", error.strerror)
            return
        log.info("connected to the watchdog")
        self._missed = False
        self._socket = connection
        asyncio.get_running_loop().add_reader(connection, self.read)

    def read(self) -> None:
        """Handle the next message, if one waits."""
        if self._socket is None:
            return
        try:
            message = self._socket.recv(LARGEST)
        except BlockingIOError:
            return
        except OSError:
            message = b""
        if not message:
            self._lost()
            return
        try:
            said = _decoder.decode(message)
        except (msgspec.DecodeError, UnicodeError):
            log.exception("a message of the watchdog could not be handled")
            return
        # compare for equality only: the clock may have been set back since the last watchdog began
        if isinstance(said, GoalsCancelled):
            self._on_cancel(said.silent_s)
        elif said.number != self._handed_on:
            self._on_press(said)
            # only after success: the watchdog sends a failed press again after the next heartbeat
            self._handed_on = said.number

    def _lost(self) -> None:
        self.close()
        self._missed = True
        log.warning("the watchdog ended: a stop depends on this process alone until it is back")
