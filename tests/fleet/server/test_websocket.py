"""WebSockets through the real web process."""

import asyncio
import time
from types import SimpleNamespace

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from fleet.server import limits
from fleet.server.websocket import WebSocket
from script.stack.stack import daphne
from teleop.live.consumers.message_socket import CloseCode
from tests.fleet.server.conftest import served
from tests.fleet.support import console_environment


def test_a_stranger_must_sign_in(web):
    with connect(f"ws://127.0.0.1:{web.port}/ws/fleet/", origin=f"http://127.0.0.1:{web.port}") as stranger:
        with pytest.raises(ConnectionClosed) as closed:
            stranger.recv()
        said = closed.value.rcvd
        assert (said.code, said.reason) == (CloseCode.SIGNED_OUT, "Sign in first.")


def test_a_handshake_with_much_behind_it_is_cut_off(web):
    head = (
        "GET /ws/fleet/ HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Origin: http://127.0.0.1\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'A' * 22}==\r\n\r\n"
    )
    sent = 0
    with web.connect() as stranger:
        stranger.sendall(head.encode())
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            while sent < 100 * 1024 * 1024:
                stranger.sendall(bytes(limits.HANDSHAKE_BYTES))
                sent += limits.HANDSHAKE_BYTES
    assert sent < 20 * 1024 * 1024


def test_handshakes_keep_no_place_of_a_request(web):
    origin = f"http://127.0.0.1:{web.port}"
    for _ in range(limits.REQUESTS_OF_ADDRESS + 10):
        with connect(f"ws://127.0.0.1:{web.port}/ws/fleet/", origin=origin, compression=None):
            pass
    assert b" 200 OK" in web.say(b"GET /healthz HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n")


def test_the_application_hears_whether_the_client_reads(tmp_path):
    application = [*daphne()[:-1], "tests.fleet.server.sized:application"]
    with (
        served(tmp_path, console_environment(tmp_path, "127.0.0.1"), application) as web,
        connect(f"ws://127.0.0.1:{web.port}/", max_size=None, max_queue=1) as client,
    ):
        client.send("much")
        time.sleep(0.5)  # the client reads only the next few messages
        count, message = 0, client.recv()
        while isinstance(message, bytes):
            count, message = count + 1, client.recv()
        assert 1 < int(message) == count < 50


def test_only_messages_of_clients_have_a_largest_size(tmp_path):
    """A robot with 500 topics has a list of 78 kB, and pictures of cameras may be larger."""
    application = [*daphne()[:-1], "tests.fleet.server.sized:application"]
    length = 10 * limits.MESSAGE_BYTES
    with served(tmp_path, console_environment(tmp_path, "127.0.0.1"), application) as web:
        address = f"ws://127.0.0.1:{web.port}/"
        with connect(address, max_size=2 * length) as client:
            client.send(str(length))
            assert {len(client.recv()), len(client.recv())} == {length}
            client.send("9" * (limits.MESSAGE_BYTES + 1))
            with pytest.raises(ConnectionClosed) as closed:
                client.recv()
            assert closed.value.rcvd.code == 1009


def test_pings_of_a_client_that_does_not_read_are_not_answered():
    answers = []
    protocol = SimpleNamespace(onMessage=None, sendPong=answers.append)
    guard = SimpleNamespace(wrappedProtocol=protocol, writable=asyncio.Event())
    WebSocket(guard, None, None)
    protocol.onPing(b"unread")
    guard.writable.set()
    protocol.onPing(b"read")
    assert answers == [b"read"]
