"""Processes of low priority hash passwords: sign-ins never delay driving or a stop.

One bcrypt hash takes a quarter of a second of a core (`docs/figures.md`). In a thread it would share the priority, and
the memory caches, of the process that answers pages. `fleet.site.sign_in_queue` limits how many sign-ins run at once.
"""

from __future__ import annotations

import os
import selectors
import subprocess
import sys
from pathlib import Path
from queue import LifoQueue
from types import SimpleNamespace
from typing import IO, Any

import bcrypt
from django.contrib.auth.hashers import BCryptSHA256PasswordHasher

PROCESSES = min(4, os.cpu_count() or 1)
PROGRAM = Path(__file__).with_name("hash_process.py")
ANSWER_S = 30.0  # a hundred times a hash: its priority is the lowest, and others may use every core


class HashProcess:
    """A process that hashes; it starts at the first use, and again if it has ended or does not answer."""

    def __init__(self) -> None:
        self._running: subprocess.Popen[bytes] | None = None

    def hash(self, text: bytes, salt: bytes) -> bytes:
        """Return the hash of a text without spaces."""
        line = b"%s %s\n" % (text, salt)
        for _attempt in range(2):
            self._running = self._running or self._start()
            if answer := self._ask(self._running, line):
                return answer
            self._running.kill()  # also one that is stopped: else it would keep its place for ever
            self._running.communicate()
            self._running = None
        raise RuntimeError("The process that hashes passwords does not answer.")

    def _start(self) -> subprocess.Popen[bytes]:
        pipe = subprocess.PIPE
        return subprocess.Popen([sys.executable, str(PROGRAM)], stdin=pipe, stdout=pipe)  # noqa: S603

    def _ask(self, running: subprocess.Popen[bytes], line: bytes) -> bytes:
        asks: IO[bytes] = running.stdin  # type: ignore[assignment]  # both are pipes
        answers: IO[bytes] = running.stdout  # type: ignore[assignment]
        try:
            asks.write(line)
            asks.flush()
            return answers.readline().strip() if _readable(answers) else b""
        except OSError:  # the process was killed
            return b""


def _readable(answers: IO[bytes]) -> bool:
    """Return whether an answer comes in time."""
    with selectors.DefaultSelector() as selector:
        selector.register(answers, selectors.EVENT_READ)
        return bool(selector.select(ANSWER_S))


_free: LifoQueue[HashProcess] = LifoQueue()  # the last one used is awake
for _ in range(PROCESSES):
    _free.put(HashProcess())


def hashpw(text: bytes, salt: bytes) -> bytes:
    """Return the bcrypt hash, made by the first process that is free."""
    process = _free.get()
    try:
        return process.hash(text, salt)
    finally:
        _free.put(process)


class BCryptInProcesses(BCryptSHA256PasswordHasher):
    """Django's bcrypt, run in the hashing processes, for known and unknown user names alike."""

    def _load_library(self) -> Any:
        return SimpleNamespace(hashpw=hashpw, gensalt=bcrypt.gensalt)
