"""Run the pages process, which answers every HTTP request except stops.

So pages and drive input do not share a Python interpreter.

The process that owns the port starts the pages process, and starts it again when it dies. `fleet.server.pages.client`
forwards requests to it over a Unix socket.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
from pathlib import Path

log = logging.getLogger(__name__)

AGAIN_S = 0.5  # pause before it is started again
LAST_S = 6.0  # time for its end, which takes 5 s at most once it serves; then it is killed


class Keeper:
    """Keep the pages process running: start it, also when it has died.

    It ends on request, or with this process.
    """

    def __init__(self, run_directory: Path, application: str) -> None:
        self.path = run_directory / f"web-{os.getpid()}.sock"
        # The pages process connects to this process here
        self.programs = run_directory / f"programs-{os.getpid()}.sock"
        self._application = application
        self._ending = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._life_line, self._ours = os.pipe2(os.O_CLOEXEC)
        run_directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        _tidy(run_directory)
        self._thread = threading.Thread(target=self._keep, name="pages", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """End the pages process."""
        if self._ending.is_set():
            return
        self._ending.set()
        os.close(self._ours)
        self.path.unlink(missing_ok=True)
        self.programs.unlink(missing_ok=True)

    def wait(self) -> None:
        """Wait for the end of the process, which may still write records.

        Kill it if it does not end in time.
        """
        self._thread.join(LAST_S)
        if self._thread.is_alive() and self._process is not None:
            self._process.kill()

    def _keep(self) -> None:
        while not self._ending.is_set():
            self.path.unlink(missing_ok=True)
            try:
                process = self._process = subprocess.Popen(  # noqa: S603
                    self._command(),
                    pass_fds=[self._life_line],
                    env={**os.environ, "FLEET_PROGRAMS_SOCKET": str(self.programs)},
                )
            except OSError as error:  # not enough memory, or too many processes: it may work later
                log.error("The pages process cannot be started: %s. It is tried again.", error)
            else:
                status = process.wait()
                if not self._ending.is_set():
                    log.error("The pages process ended with status %d. It is started again.", status)
            self._ending.wait(AGAIN_S)

    def _command(self) -> list[str]:
        return [
            *(sys.executable, "-m", "fleet.server.pages.server", "--life-line", str(self._life_line)),
            *("--socket", str(self.path), self._application),
        ]


def _tidy(run_directory: Path) -> None:
    """Remove the sockets of processes that were killed."""
    for left in [*run_directory.glob("web-*.sock"), *run_directory.glob("programs-*.sock")]:
        if not Path(f"/proc/{left.stem.split('-')[1]}").exists():
            left.unlink(missing_ok=True)
