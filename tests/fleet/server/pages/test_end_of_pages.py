"""A pages process that is asked to end, while it answers."""

import os
import signal
import socket
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from script.stack.processes import Child, end_all
from script.stack.stack import daphne
from tests.fleet.server.conftest import Web
from tests.fleet.server.pages.test_pages import ask, pages_process
from tests.fleet.support import console_environment
from tests.processes import until


@pytest.fixture(scope="module")
def lasting(tmp_path_factory):
    """A web process with an application that never completes its first answers."""
    directory = tmp_path_factory.mktemp("lasting")
    environ = console_environment(directory, "127.0.0.1")
    command = [*daphne()[:-1], "tests.fleet.server.pages.lasting:application"]
    with socket.create_server(("127.0.0.1", 0)) as free:
        fd = free.fileno()
        child = Child("web", [*command, "--fd", str(fd)], env=environ, log=directory / "web.log", fds=[fd])
        try:
            yield Web(child, free.getsockname()[1], environ)
        finally:
            end_all([child])


@pytest.mark.parametrize(("method", "status"), [("GET", 200), ("POST", 503)])
def test_a_request_in_flight_is_repeated_or_answered_in_words(lasting, method, status):
    """A request that may have changed something is not repeated."""
    assert ask(lasting, "GET", "/")[0] == 200  # opens the connection between the processes
    with ThreadPoolExecutor(1) as person:
        answer = person.submit(ask, lasting, method, "/lasting")
        until(Path(lasting.environ["FLEET_VAR"], method).exists, "the answer is begun", 30)
        os.kill(pages_process(lasting), signal.SIGTERM)
        found, body, headers = answer.result(60)
    assert found == status
    if status == 503:
        assert b'"no_answer"' in body and headers["Retry-After"]
