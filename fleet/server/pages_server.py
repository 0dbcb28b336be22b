"""The program of the pages process: `python -m fleet.server.pages_server --life-line FD --socket PATH APPLICATION`.

The process that owns the port has applied the limits, so Uvicorn serves here: a request takes half of Daphne's time.
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

from robots.processes.scheduling import prefer_nobody
from robots.processes.shutdown import SIGNALS, exit_within

NICENESS = 15
END_S = 5.0
LOADED_S = 60.0  # a busy computer may load the application for seconds; until then nothing needs an end in time
REQUESTS_END_S = 1  # then those that still run are cut


class Server(uvicorn.Server):
    """Ends by a signal or with the process that owns the port, and waits for its threads as Python does."""

    def handle_exit(self, _signal: int, _frame: FrameType | None) -> None:
        """End. Uvicorn's own way kills the process by the same signal, while threads still write records."""
        self.end()

    def end(self) -> None:
        """Take no more requests, answer those of the next second, and end."""
        exit_within(END_S if self.started else LOADED_S)
        self.should_exit = True

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Cut what still runs after `REQUESTS_END_S`. Uvicorn would answer it with a bare 500; the process that owns
        the port hears that there is no answer, asks once more where that does no harm, and else says so."""
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
    prefer_nobody()
    server = Server(
        uvicorn.Config(
            asked.application,
            http="httptools",
            ws="none",
            lifespan="off",
            log_config=None,  # Django's
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
    server.run([_listening(asked.socket)])
    asked.socket.unlink(missing_ok=True)  # the life line may have ended before there was one
    for number in SIGNALS:  # a second one must not kill threads that still write records
        signal.signal(number, signal.SIG_IGN)


def _listening(path: Path) -> socket.socket:
    """Return a socket for this account only."""
    listening = socket.socket(socket.AF_UNIX)
    mask = os.umask(0o177)
    listening.bind(str(path))
    os.umask(mask)
    return listening


def _end_with(life_line: int, path: Path, server: Server) -> None:
    os.read(life_line, 1)  # nobody writes: this is its end
    path.unlink(missing_ok=True)
    if programs := os.environ.get("FLEET_PROGRAMS_SOCKET"):  # a process that was killed leaves it
        Path(programs).unlink(missing_ok=True)
    server.end()


if __name__ == "__main__":
    main()
