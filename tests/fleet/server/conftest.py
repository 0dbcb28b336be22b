"""A real web process, and clients with plain sockets."""

import http.client
import json
import os
import re
import socket
import sqlite3
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import daphne.server
import pytest

from script.stack.processes import Child, end_all
from script.stack.stack import daphne
from tests.conftest import PASSWORD
from tests.fleet.server.crowd import Crowd, Watchdog
from tests.fleet.support import console_environment, empty_database
from tests.processes import REPOSITORY

READY_S = 60


class Web:
    """A running web process."""

    def __init__(self, child, port, environ):
        self.child = child
        self.port = port
        self.environ = environ

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=30)

    def say(self, data):
        """Send these bytes on a new connection; return all bytes until it closes."""
        with self.connect() as stranger:
            stranger.sendall(data)
            return heard(stranger)

    def resident_bytes(self):
        """Resident memory of the process that owns the port."""
        pages = int(Path(f"/proc/{self.child.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGESIZE")


@pytest.fixture(scope="session")
def session_cookie(web):
    """Name of the session cookie. It differs between consoles on one host and is public."""
    connection = http.client.HTTPConnection("127.0.0.1", web.port)
    connection.request("GET", "/cookies/")
    return re.search(r"fleet_session_\w+", connection.getresponse().read().decode())[0]


@pytest.fixture(scope="session")
def session_key(web):
    """Key of an existing session without a person."""
    key = "s" * 32
    with sqlite3.connect(Path(web.environ["FLEET_VAR"]) / "fleet.sqlite3") as database:
        database.execute("INSERT INTO django_session VALUES (?, '', '2100-01-01')", [key])
    database.close()
    return key


def heard(stranger):
    """Read until the server closes the connection."""
    parts = []
    try:
        while part := stranger.recv(65536):
            parts.append(part)
    except ConnectionResetError:
        pass
    return b"".join(parts)


@pytest.fixture(scope="session")
def console(tmp_path_factory):
    """Environment and people of a console; one of its accounts is "first"."""
    environ = console_environment(tmp_path_factory.mktemp("web"), "127.0.0.1")
    empty_database(environ)
    made = subprocess.run(
        [sys.executable, "-m", "tests.fleet.server.make_crowd", PASSWORD],
        cwd=REPOSITORY,
        env={**environ, "DJANGO_SETTINGS_MODULE": "fleet.settings"},
        stdout=subprocess.PIPE,
        check=True,
    )
    return environ, json.loads(made.stdout.splitlines()[-1])


@pytest.fixture(scope="session")
def web(console):
    """A web process on a free port."""
    environ, _people = console
    with served(Path(environ["FLEET_VAR"]).parent, environ, daphne()) as running:
        yield running


@contextmanager
def served(directory, environ, command):
    """Run this web process on a free port, for the length of a `with` block."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        child = Child(
            "web",
            [*command, "--fd", str(free.fileno())],
            env=environ,
            log=directory / "web.log",
            fds=[free.fileno()],
        )
        running = Web(child, free.getsockname()[1], environ)
        try:
            _wait_until_it_answers(running)
            yield running
        finally:
            end_all([child])


def _wait_until_it_answers(web):
    deadline = time.monotonic() + READY_S
    while time.monotonic() < deadline and web.child.running:
        if b" 200 OK" in web.say(b"GET /healthz HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n"):
            return
        time.sleep(0.05)
    pytest.fail(f"no web process: {web.child.last_lines()}")


@pytest.fixture
def crowd(web, console):
    """The people, with a watchdog of each robot."""
    _environ, people = console
    run = Path(web.environ["FLEET_VAR"], "run")
    watchdogs = [
        Watchdog(run / f"{people['robots'][slug][:12]}.stop")
        for slug in ("in-service", "out-of-service", "apart")
    ]
    yield Crowd(web, people, watchdogs)
    for watchdog in watchdogs:
        watchdog.close()
