"""The program of the pages process: `python -m fleet.server.pages.server --life-line FD --socket PATH APPLICATION`.

The process that owns the port has applied the limits, so Uvicorn can serve here: it needs half of Daphne's
time for a request.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import socket
import threading
from pathlib import Path
from types import FrameType

import uvicorn

from fleet.base.database import schema
from fleet.base.version import log_start
from robots.shared.processes.scheduling import forbid_real_time
from robots.shared.processes.shutdown import SIGNALS, exit_within

NICENESS = 15
END_S = 5.0
LOADED_S = 60.0  # a busy computer loads the application for seconds; no request runs until then
REQUESTS_END_S = 1  # requests that still run after this time are cut off


class Server(uvicorn.Server):
    """The server.

    It ends by a signal or with the process that owns the port, and waits for its threads like Python.
    """

    def handle_exit(self, _signal: int, _frame: FrameType | None) -> None:
        """End.

        Uvicorn's own method kills the process by the same signal, while threads still write records.
        """
        self.end()

    def end(self) -> None:
        """Accept no more requests, answer those that end within a second, and end."""
        exit_within(END_S if self.started else LOADED_S)
        self.should_exit = True

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the connections of requests that still run after `REQUESTS_END_S`.

        Uvicorn would answer them with a bare 500. Without an answer, the process that owns the port sends the
        request again if that does no harm; else it sends a refusal.
        """
        asyncio.get_running_loop().call_later(REQUESTS_END_S, self._cut)
        await super().shutdown(sockets)

    def _cut(self) -> None:
        for connection in self.server_state.connections:
            connection.transport.abort()


def main() -> None:
    """Serve until the other end of the life line is closed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--life-line", type=int, required=True, help="the read end of a pipe")
    parser.add_argument(
        "--socket", type=Path, required=True, help="where the process that owns the port connects"
    )
    parser.add_argument("application")
    asked = parser.parse_args()
    os.nice(NICENESS)
    forbid_real_time()
    server = Server(
        uvicorn.Config(
            asked.application,
            http="httptools",
            ws="none",
            lifespan="off",
            log_config=None,  # Django configures logging
            access_log=False,
            server_header=False,
            forwarded_allow_ips="*",
            timeout_keep_alive=60,
            timeout_graceful_shutdown=REQUESTS_END_S,
        )
    )
    threading.Thread(
        target=_end_with, args=(asked.life_line, asked.socket, server), name="life line", daemon=True
    ).start()
    server.config.load()  # before anybody can connect
    log_start("pages process")
    schema.guard()  # it answers that the database is refused, and /healthz says so
    server.run([_listening(asked.socket)])
    asked.socket.unlink(missing_ok=True)  # the life line may have ended before the socket was made
    for number in SIGNALS:  # a second signal must not kill threads that still write records
        signal.signal(number, signal.SIG_IGN)


def _listening(path: Path) -> socket.socket:
    """Return a listening socket that only this account can use."""
    listening = socket.socket(socket.AF_UNIX)
    mask = os.umask(0o177)
    listening.bind(str(path))
    os.umask(mask)
    return listening


def _end_with(life_line: int, path: Path, server: Server) -> None:
    os.read(life_line, 1)  # nobody writes to the pipe: this returns when the other end is closed
    path.unlink(missing_ok=True)
    if programs := os.environ.get("FLEET_PROGRAMS_SOCKET"):  # a killed process leaves its socket
        Path(programs).unlink(missing_ok=True)
    server.end()


if __name__ == "__main__":
    main()
