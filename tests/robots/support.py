"""Waiting for other processes, and fake programs for the supervisor."""

from __future__ import annotations

import sys
from pathlib import Path

# Logs its start; ends when its standard input closes. With a file crash-NAME next to the log, it exits at once.
POLITE = """
import os, pathlib, sys
log = pathlib.Path(os.environ["FAKE_LOG"])
name = sys.argv[-1]
with log.open("a") as lines:
    print("start", name, os.getpid(), file=lines)
if (log.parent / f"crash-{name}").exists():
    sys.exit(int((log.parent / f"crash-{name}").read_text() or 7))
sys.stdin.read()
with log.open("a") as lines:
    print("end", name, file=lines)
"""

# Ignores both its standard input and SIGTERM.
STUBBORN = """
import os, pathlib, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
with pathlib.Path(os.environ["FAKE_LOG"]).open("a") as lines:
    print("start", sys.argv[-1], os.getpid(), file=lines)
time.sleep(60)
"""


class FakePrograms:
    """A folder with a program and the log of the program's processes."""

    def __init__(self, folder: Path, source: str = POLITE) -> None:
        self.folder = folder
        self.log = folder / "log"
        self.log.touch()
        self.script = folder / "program.py"
        self.script.write_text(source)

    def arguments(self, name: str) -> list[str]:
        """Return the command line that runs the program under this name."""
        return [sys.executable, str(self.script), name]

    def lines(self) -> list[str]:
        """Return the log's lines without process ids."""
        return [" ".join(line.split()[:2]) for line in self.log.read_text().splitlines()]

    def pids(self, name: str) -> list[int]:
        """Return the ids of the processes started under this name, in order."""
        lines = (line.split() for line in self.log.read_text().splitlines())
        return [int(words[2]) for words in lines if words[:2] == ["start", name]]
