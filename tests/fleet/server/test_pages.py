"""Pages have a process of their own, which may die and takes nothing with it."""

import http.client
import os
import signal

from benchmarks.parts.proc import children
from tests.script.support import command_line, until


def pages_process(web):
    """Its number."""
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


def test_a_stop_is_answered_while_pages_are_not(web):
    """403: a form without its token. Django said so, in the process that owns the port."""
    cookie = ask(web, "GET", "/cookies/")[1].decode().split("fleet_session_")[1][:8]
    frozen = pages_process(web)
    os.kill(frozen, signal.SIGSTOP)
    try:
        status, _body, _headers = ask(web, "POST", "/stop-all/", Cookie=f"fleet_session_{cookie}=x")
    finally:
        os.kill(frozen, signal.SIGCONT)
    assert status == 403


def test_a_large_answer_arrives_whole(web):
    status, body, headers = ask(web, "GET", "/static/vendor/uplot/uPlot.iife.js")
    assert status == 200
    assert len(body) == int(headers["Content-Length"]) > 100_000


def test_no_header_of_a_stranger_says_where_a_request_came_from(web):
    """With the root path of a stranger, redirects would lead where he likes."""
    forged = {"Daphne-Root-Path": "/evil", "X-Forwarded-For": "10.0.0.7", "X-Forwarded-Proto": "https"}
    status, _body, headers = ask(web, "GET", "/", **forged, Accept="text/html")
    assert (status, headers["Location"]) == (302, "/accounts/sign-in/?next=/")
