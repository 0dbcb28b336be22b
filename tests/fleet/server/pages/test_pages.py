"""Pages are answered by a separate process, which may die without harm."""

import http.client
import os
import signal
import subprocess
import sys

import pytest

from benchmarks.parts.process_stats import children
from tests.fleet.server.conftest import heard
from tests.processes import until
from tests.script.support import command_line


def pages_process(web):
    """Process id of the pages process."""
    [pid] = [pid for pid in children(web.child.pid) if "--life-line" in command_line(pid)]
    return pid


def ask(web, method, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", web.port, timeout=60)
    try:
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read(), answer.headers
    finally:
        connection.close()


def test_pages_come_back_when_their_process_dies(web):
    first = pages_process(web)
    assert ask(web, "GET", "/healthz")[0] == 200
    os.kill(first, signal.SIGKILL)
    until(lambda: ask(web, "GET", "/healthz")[0] == 200, "pages answer again", 30)
    assert pages_process(web) != first
    assert web.child.running


def test_a_stranger_who_claims_a_session_waits_for_the_pages(web, session_cookie):
    """Otherwise anybody could keep the driving process busy: the cookie's name is public."""
    claim = f"POST /api/stop/ HTTP/1.0\r\nHost: 127.0.0.1\r\nCookie: {session_cookie}={'x' * 32}\r\n\r\n"
    frozen = pages_process(web)
    with web.connect() as stranger:
        os.kill(frozen, signal.SIGSTOP)
        try:
            stranger.settimeout(1.0)
            stranger.sendall(claim.encode())
            with pytest.raises(TimeoutError):
                stranger.recv(65536)
        finally:
            os.kill(frozen, signal.SIGCONT)
        stranger.settimeout(30.0)
        assert b" 401 " in heard(stranger)


def test_a_large_answer_arrives_whole(web):
    status, body, headers = ask(web, "GET", "/static/vendor/uplot/uPlot.iife.js")
    assert status == 200
    assert len(body) == int(headers["Content-Length"]) > 100_000


def test_a_head_request_has_the_length_of_get(web):
    path = "/static/vendor/uplot/uPlot.iife.js"
    status, body, headers = ask(web, "HEAD", path)
    assert (status, body) == (200, b"")
    assert headers["Content-Length"] == ask(web, "GET", path)[2]["Content-Length"]


@pytest.mark.parametrize("line", [b"GET /\xe4", b"G\xc4T /", b"CONNECT /", b"FOO /"])
def test_a_method_or_an_address_that_is_none_is_malformed(web, line):
    answer = web.say(line + b" HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n")
    assert (answer.split()[1], b'"malformed"' in answer) == (b"400", True)


def test_no_header_of_a_stranger_says_where_a_request_came_from(web):
    """A root path from a stranger could redirect people anywhere."""
    forged = {"Daphne-Root-Path": "/evil", "X-Forwarded-For": "10.0.0.7", "X-Forwarded-Proto": "https"}
    status, _body, headers = ask(web, "GET", "/", **forged, Accept="text/html")
    assert (status, headers["Location"]) == (302, "/accounts/sign-in/?next=/")


def test_a_pages_process_whose_parent_ends_at_once_leaves_no_socket(web, tmp_path):
    path = tmp_path / "pages.sock"
    life_line, ours = os.pipe()
    try:
        pages = subprocess.Popen(
            [
                *(sys.executable, "-m", "fleet.server.pages.server", "--life-line", str(life_line)),
                *("--socket", str(path), "fleet.site.asgi:application"),
            ],
            env=web.environ,
            pass_fds=[life_line],
        )
    finally:
        os.close(life_line)
        os.close(ours)
    assert pages.wait(60) == 0
    assert not path.exists()
