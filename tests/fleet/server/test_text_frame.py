"""The quick reader of small texts reads as Autobahn does, or leaves the bytes to it."""

from __future__ import annotations

import base64
import time

import pytest
from autobahn.twisted.websocket import WebSocketServerFactory, WebSocketServerProtocol
from hypothesis import example, given
from hypothesis import strategies as st
from twisted.internet.testing import StringTransport
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from fleet.server.text_frame import message_frame, small_text_frame
from script.stack.stack import daphne
from tests.fleet.server.conftest import served
from tests.fleet.support import console_environment

HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: %b\r\n\r\n" % base64.b64encode(bytes(16))
)
MASK = b"abcd"


class Reader(WebSocketServerProtocol):  # type: ignore[misc]
    """Autobahn's reader; it keeps the messages."""

    def onOpen(self) -> None:
        self.heard: list[tuple[bytes, bool]] = []

    def onMessage(self, payload: bytes, isBinary: bool) -> None:
        self.heard.append((payload, isBinary))


def read_by_autobahn(data: bytes) -> list[tuple[bytes, bool]]:
    factory = WebSocketServerFactory()
    factory.protocol = Reader
    reader = factory.buildProtocol(None)
    reader.makeConnection(StringTransport())
    reader.dataReceived(HANDSHAKE)
    reader.dataReceived(data)
    whole = not (reader.data or reader.current_frame or reader.inside_message)
    return reader.heard if whole and reader.state == reader.STATE_OPEN else []


def frame(payload: bytes, first: int = 0x81) -> bytes:
    size = len(payload)
    length = bytes([0x80 | size]) if size < 126 else bytes([0xFE]) + size.to_bytes(2, "big")
    masked = bytes(byte ^ MASK[place % 4] for place, byte in enumerate(payload))
    return bytes([first]) + length + MASK + masked


@pytest.mark.parametrize("length", [0, 1, 125, 126, 65535, 65536])
def test_messages_are_framed_as_by_autobahn(length):
    factory = WebSocketServerFactory()
    for message, is_binary in (("é" + "x" * length, False), (bytes(length), True)):
        payload = message if is_binary else message.encode()
        assert message_frame(message) == factory.prepareMessage(payload, is_binary).payloadHybi


def changed(data: bytes, place: int, byte: int) -> bytes:
    place %= len(data)
    return data[:place] + bytes([byte]) + data[place + 1 :]


texts = st.one_of(st.text(max_size=1000).map(str.encode), st.binary(max_size=300))
frames = st.builds(frame, texts, st.sampled_from([0x81, 0x81, 0x82, 0x01, 0x80, 0x89, 0x8A, 0xC1]))


@given(st.one_of(frames, st.builds(changed, frames, st.integers(0, 12), st.integers(0, 255))))
@example(frame(b""))
@example(frame(b"x" * 126))
@example(frame(b"\xed\xa0\x80"))  # half of a surrogate pair
@example(frame(b"\xe2\x82"))  # the beginning of a character
@example(b"\x81\xfe\x00\x02" + MASK + b"\x00\x00")  # not the shortest form of the length
@example(frame(b"a") + frame(b"b"))
def test_a_text_is_read_as_by_autobahn_or_left_to_it(data):
    text = small_text_frame(data)
    assert text is None or read_by_autobahn(data) == [(text, False)]


def test_a_whole_text_is_read():
    assert small_text_frame(frame(b'{"t":"drive"}')) == b'{"t":"drive"}'


def test_inside_a_frame_or_message_nothing_is_taken_for_a_text(tmp_path):
    """A whole text in a message breaks the protocol, so Autobahn closes the WebSocket."""
    application = [*daphne()[:-1], "tests.fleet.server.sized:application"]
    with served(tmp_path, console_environment(tmp_path, "127.0.0.1"), application) as web:
        for begun in (b"\x81", b"\x89\x88" + bytes(4), b"\x01\x81" + bytes(4) + b"1"):
            with connect(f"ws://127.0.0.1:{web.port}/", compression=None) as client:
                client.socket.sendall(begun)
                time.sleep(0.05)  # the server reads the piece; if it is late, it reads all at once
                client.socket.sendall(frame(b"20"))
                if begun[0] == 0x89:  # a ping: the text is what it carries
                    client.send("30")
                    assert len(client.recv()) == 30
                    continue
                with pytest.raises(ConnectionClosed):
                    client.recv()


def test_a_text_before_the_handshakes_answer_waits(tmp_path):
    application = [*daphne()[:-1], "tests.fleet.server.sized:application"]
    with (
        served(tmp_path, console_environment(tmp_path, "127.0.0.1"), application) as web,
        web.connect() as early,
    ):
        early.sendall(HANDSHAKE.replace(b"GET / ", b"GET /late ").replace(b"Host: a", b"Host: 127.0.0.1"))
        time.sleep(0.1)  # the application runs, and accepts after 0.2 s
        early.sendall(frame(b"5"))
        heard = b""
        while not heard.endswith(b"x" * 5 + b"\x82\x05" + bytes(5)):
            piece = early.recv(1000)
            assert piece, "the connection was closed"
            heard += piece
