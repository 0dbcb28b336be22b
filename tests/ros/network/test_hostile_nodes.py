"""Servers that are no ROS node or master do not harm a bridge that calls them."""

from __future__ import annotations

import itertools
import queue
import socket
import threading
import time
import xmlrpc.client
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from robots.bridge.ros.inspector.graph import graph
from robots.bridge.ros.network.tcpros import Conversation, connect, first_response
from robots.bridge.ros.node import RosBase
from robots.shared.graph import SystemState
from robots.shared.ros import master
from robots.shared.ros.master import TIMEOUT_S, Master, MasterError
from tests.bridge.support import CONFIG
from tests.processes import serving, until
from tests.ros.spoiled_master import answer_of


@contextmanager
def answering(answer: bytes) -> Iterator[str]:
    """Yield the address of a server that answers every call with these bytes."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            # An unread request would cut off a long answer
            self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200)
            self.send_header("Content-Length", str(len(answer)))
            self.end_headers()
            self.wfile.write(answer)

        def log_message(self, *_: object) -> None: ...

    server = HTTPServer(("127.0.0.1", 0), Handler)
    with serving(server):
        yield f"http://127.0.0.1:{server.server_port}"


def answer_with(value: str) -> bytes:
    return f"<methodResponse><params><param><value>{value}</value></param></params></methodResponse>".encode()


@pytest.mark.parametrize(
    "answer", [b"<", b"", b"hello", answer_with("<int>5</int>"), answer_with("<string>x</string>")]
)
def test_a_server_that_is_no_master_is_a_masters_error(answer):
    with answering(answer) as uri, pytest.raises(MasterError, match="No ROS master"):
        Master(uri, "/test").alive()


@pytest.mark.parametrize("shape", [5, "x", [], [[["/scan"]], [], []], [[["/scan", "/base"]], [], []]])
def test_misshapen_topics_are_an_error_of_the_master(shape):
    with answering(answer_of(shape)) as uri:
        for ask in (Master.system_state, partial(graph, seq=1)):
            with pytest.raises(MasterError, match="No ROS master"):
                ask(Master(uri, "/test"))


def test_no_answer_is_not_taken_for_none_of_that_name():
    with answering(b"<") as uri:
        for ask in (Master(uri, "/test").parameter, Master(uri, "/test").node_uri):
            with pytest.raises(MasterError, match="No ROS master"):
                ask("/name")
    with answering(xmlrpc.client.dumps(([-1, "unknown", 0],), methodresponse=True).encode()) as uri:
        assert Master(uri, "/test").parameter("/name") is Master(uri, "/test").node_uri("/name") is None


@contextmanager
def dripping(parts: Iterable[bytes], pause_s: float) -> Iterator[tuple[str, queue.SimpleQueue[float]]]:
    """A master that answers one call in parts with pauses. Yields its address, and a queue with the call's time (s)."""
    heard: queue.SimpleQueue[float] = queue.SimpleQueue()
    over = threading.Event()

    def serve() -> None:
        connection, _ = listener.accept()
        began_s = time.monotonic()
        with connection, connection.makefile("rb") as asked, suppress(OSError):
            # An unread request would cut off the answer
            any(line.startswith(b"</methodCall>") for line in asked)
            connection.sendall(b"HTTP/1.0 200 OK\r\n\r\n")
            for part in parts:
                if over.wait(pause_s):
                    break
                connection.sendall(part)
        heard.put(time.monotonic() - began_s)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}/", heard
        finally:
            over.set()
            thread.join()


def test_a_master_that_answers_in_drips_is_given_up(monkeypatch):
    monkeypatch.setattr(master, "WHOLE_S", 0.5)
    with dripping(itertools.repeat(b" "), 0.02) as (uri, heard):
        with pytest.raises(MasterError, match="does not answer"):
            Master(uri, "/test").alive()
        assert 0.5 < heard.get(timeout=10) < 5.0


def test_a_slow_but_steady_answer_is_read_to_its_end():
    answer = answer_of("a long one")
    parts = [answer[at : at + 20] for at in range(0, len(answer), 20)]
    with dripping(parts, 1.2 * TIMEOUT_S / len(parts)) as (uri, _):
        assert Master(uri, "/test").call("getParam", "/story") == "a long one"


@pytest.mark.parametrize("header", [b"\x01", b"\x00\x00\x00", b"\x01\x00\x00\x00x\x07"])
def test_a_header_that_is_cut_short_is_an_error_in_words(header):
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(len(header).to_bytes(4, "little") + header)
        with pytest.raises(ValueError, match="does not speak TCPROS"):
            Conversation(ours, time.monotonic() + 10).read_header()


@pytest.mark.parametrize("where", [7, "x", [], ["TCPROS"], ["TCPROS", 5, 5], ["TCPROS", "here", "x"]])
def test_a_publisher_with_a_bad_address_cannot_be_heard(where):
    with answering(answer_of(where)) as uri:
        heard = first_response(Conversation.read_header, "/scan", {"/base": uri}, "/test")
    assert heard == (None, {"/base": "does not offer TCPROS"})


def test_an_unusable_connection_without_owner_is_closed(monkeypatch):
    def fails(*_message) -> None:
        raise TimeoutError("timed out")

    monkeypatch.setattr(Conversation, "send", fails)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        with pytest.raises(TimeoutError) as caught:
            connect("127.0.0.1", listener.getsockname()[1], {})
        connection, _ = listener.accept()
        with connection:
            connection.settimeout(1.0)
            assert connection.recv(1) == b"", caught  # the traceback still holds unclosed sockets


def test_a_silent_name_server_delays_no_survey(monkeypatch):
    asked, over = threading.Event(), threading.Event()

    def hangs(*_name):
        asked.set()
        over.wait(10)
        raise socket.gaierror(socket.EAI_AGAIN, "no name server answers")

    monkeypatch.setattr(socket, "getaddrinfo", hangs)
    monkeypatch.setattr(Master, "node_uri", lambda *_: "http://tiago-9c:1/")
    base = RosBase(CONFIG)
    system = SystemState({CONFIG.topics.odometry.name: ["/base"]}, {}, {}, {})
    assert base._problems(system) == []
    assert asked.wait(10)
    assert base._problems(system) == []
    over.set()
    [text] = until(lambda: base._problems(system), "the name that is not known")
    assert text.startswith("The robot calls itself tiago-9c, which cannot be resolved here")
