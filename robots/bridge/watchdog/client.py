"""The bridge's end of the watchdog's socket: beats out, stops in. Lives on the event loop; nothing here waits."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable

import msgspec
from msgspec import structs

from robots import wire
from robots.bridge.watchdog.rules import Heartbeat, StopPress
from robots.bridge.watchdog.socket import LARGEST

log = logging.getLogger(__name__)

MISSING_S = 5.0  # one that ended is back within about a second

_decoder = msgspec.json.Decoder(StopPress)


class WatchdogClient:
    """Connects whenever a watchdog is there. `on_press` is told each stop that the watchdog heard, once."""

    def __init__(self, path: str, on_press: Callable[[StopPress], None]) -> None:
        self._path = path
        self._on_press = on_press
        self._socket: socket.socket | None = None
        self._told = 0  # number of the newest press that was handed on
        self._heard = 0  # and of the one that was written to the state file last
        self._missed = False  # that no watchdog is there was said
        self._taken_s = float("-inf")  # when a beat was taken last
        self._since_s = float("inf")  # of the first one that was sent

    @property
    def connected(self) -> bool:
        """Whether a watchdog is there."""
        return self._socket is not None

    def missing(self, now_s: float) -> bool:
        """Whether no watchdog took a beat for `MISSING_S`: none is there, or it is frozen."""
        return now_s - max(self._taken_s, self._since_s) > MISSING_S

    def beat(self, beat: Heartbeat, now_s: float) -> None:
        """Say what the bridge does now."""
        self._since_s = min(self._since_s, now_s)
        if self._socket is None:
            self._connect()
        if self._socket is None:
            return
        try:
            self._socket.send(wire.encode(structs.replace(beat, heard=self._heard)), socket.MSG_NOSIGNAL)
            self._taken_s = now_s
        except BlockingIOError:  # it is frozen
            pass
        except OSError:
            self._lost()

    def heard(self, number: int) -> None:
        """The stop of this number is latched here and written."""
        self._heard = number

    def close(self) -> None:
        """The bridge ends."""
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
                log.warning("no watchdog is there (%s): a stop depends on this process alone", error.strerror)
            return
        log.info("a watchdog is there")
        self._missed = False
        self._socket = connection
        asyncio.get_running_loop().add_reader(connection, self._read)

    def _read(self) -> None:
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
            press = _decoder.decode(message)
        except msgspec.DecodeError:
            log.exception("the watchdog was not understood")
            return
        if (
            press.number != self._told
        ):  # no order: the clock may have been set back since the last watchdog began
            self._on_press(press)
            self._told = press.number  # one that broke is told again with the next beat

    def _lost(self) -> None:
        self.close()
        self._missed = True
        log.warning("the watchdog is gone: a stop depends on this process alone until it is back")
