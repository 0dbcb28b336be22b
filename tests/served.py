"""A process beside the bridge that serves web processes, and the connection of one to it."""

from __future__ import annotations

import shutil
import threading
from contextlib import ExitStack, suppress
from pathlib import Path

import msgspec
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import unix_connect

from robots.bridge.served.client import Served
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from tests.forked import ForkedProgram, forks_of
from tests.processes import PATIENCE_S


class ServedProcess:
    """One such process. Subclasses take what it sends."""

    def __init__(
        self,
        served: Served,
        config: BridgeConfig,
        environment: dict[str, str],
        errors: Path | None = None,
    ) -> None:
        self._sockets = Path(config.link.unix_path).parent
        self._sockets.mkdir()
        program, forks = served.command(config.ros)[-1], forks_of(config.ros)
        self.process = ForkedProgram(program, log=errors, environment=environment, forks=forks, talks=True)
        self.process.stdin.write(msgspec.json.encode(config) + b"\n")
        self.process.stdin.flush()
        self.at = msgspec.json.decode(self.process.stdout.readline(), type=wire.ProcessAt)
        self._closing = ExitStack()
        connection = unix_connect(self.at.unix_path, compression=None, max_size=None, ping_interval=None)
        self._socket = self._closing.enter_context(connection)
        threading.Thread(target=self._read, daemon=True).start()

    def received(self, message: str | bytes) -> None:
        """Take a message."""
        raise NotImplementedError

    def say(self, message: msgspec.Struct) -> None:
        """Send a request."""
        self._socket.send(wire.encode(message).decode())

    def stop(self, status: int = 0) -> None:
        self._closing.close()
        self.process.stdin.close()  # the same happens when the bridge dies
        assert self.process.wait(PATIENCE_S) == status
        self.process.stdout.close()
        shutil.rmtree(self._sockets, ignore_errors=True)

    def _read(self) -> None:
        with suppress(ConnectionClosed):
            while True:
                self.received(self._socket.recv())
