"""The fast path for whole texts and the full parser give the same results, however the bytes are cut."""

from __future__ import annotations

import random
import struct
from types import SimpleNamespace

import pytest
from twisted.internet.testing import StringTransport

from fleet.server import limits, websocket
from fleet.server.command import Server
from fleet.server.text_frame import small_text_frame

ROUNDS = 4000
HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
DRIVE = b'{"t":"drive","fence":2,"seq":7,"sent_ms":12345.6,"x":0,"w":0.3,"share":0.4}'
TEXTS = [
    DRIVE,
    b"",
    b"{}",
    DRIVE + b" " * 60,
    "€".encode() * 60,
    "𝄞".encode(),
    b"\xed\xa0\x80",  # half of a surrogate pair
    b"\xc0\xaf",  # overlong encoding
    b"\xf4\x90\x80\x80",  # beyond the last code point
    b"\xe2\x82",  # truncated
    b"x" * 2000,
    b"x" * (limits.MESSAGE_BYTES + 1),
]


class Queue(list):
    """Stores the messages for the console."""

    put_nowait = list.append

    def qsize(self):
        return 0

    def empty(self):
        return True


class Transport(StringTransport):
    """Stores how the connection ended."""

    aborted = False

    def unregisterProducer(self):
        pass

    def abortConnection(self):
        self.aborted = True
        super().abortConnection()


class End:
    """The server's end of a WebSocket, without a network."""

    def __init__(self) -> None:
        self.heard = Queue()
        places = SimpleNamespace(take=lambda _: True, give_back=lambda _: None)
        server = SimpleNamespace(
            protocol_connected=lambda _: None, protocol_disconnected=lambda _: None, left=lambda _: None,
            log_action=lambda *_: None, create_application=lambda *_: self.heard, websockets=places,
            root_path="", proxy_forwarded_address_header=None,
        )  # fmt: skip
        factory = websocket.Factory(server, server="test")
        factory.setProtocolOptions(
            maxMessagePayloadSize=limits.MESSAGE_BYTES, maxFramePayloadSize=limits.MESSAGE_BYTES
        )
        self.transport = Transport()
        self.protocol = factory.buildProtocol(None)
        self.protocol._raw_query_string = b""
        self.protocol.makeConnection(self.transport)
        self.protocol.dataReceived(HANDSHAKE)
        self.protocol.serverAccept()
        self.heard.clear()
        self.transport.clear()

    def outcome(self, parts):
        """Return messages, answers and end for these pieces of bytes in order."""
        for part in parts:
            self.protocol.dataReceived(part)
        return (
            self.heard,
            self.transport.value(),
            self.transport.aborted,
            self.transport.disconnecting,
            self.protocol.state,
        )


def frame(chance, first=0x81, payload=DRIVE, masked=True, way=None):
    length = len(payload)
    way = way or (1 if length < 126 else 2 if length < 65536 else 8)
    head = {
        1: bytes([length & 0x7F]),
        2: b"\x7e" + struct.pack("!H", length & 0xFFFF),
        8: b"\x7f" + struct.pack("!Q", length),
    }[way]
    if not masked:
        return bytes([first]) + head + payload
    mask = chance.randbytes(4)
    body = bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
    return bytes([first, head[0] | 0x80]) + head[1:] + mask + body


COMMAND = frame(random.Random(0))  # noqa: S311 - the same in every run


def some_frames(chance):
    found = b""
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        if chance.random() < 0.5:
            found += frame(chance, payload=chance.choice(TEXTS[:10]))
        else:
            found += frame(
                chance,
                first=chance.choice([0x81, 0x01, 0x80, 0x00, 0x82, 0x89, 0x8A, 0x88, 0xC1, 0x83, 0x8B, 0x09]),
                payload=chance.choice([*TEXTS, b"\x03\xe8", b"ping"]),
                masked=chance.random() < 0.9,
                way=chance.choice([None, None, None, 2, 8]),
            )
    if chance.random() < 0.3:  # corrupt one byte of the beginning
        place = chance.randrange(min(len(found), 10))
        found = found[:place] + chance.randbytes(1) + found[place + 1 :]
    return found


def cut(chance, data):
    """Cut bytes in pieces; mostly one piece."""
    if chance.random() < 0.5:
        return [data]
    places = sorted(chance.randrange(len(data) + 1) for _ in range(chance.choice([1, 2])))
    return [part for part in map(lambda a, b: data[a:b], [0, *places], [*places, len(data)]) if part]


@pytest.mark.parametrize("seed", range(4))
def test_mutated_frames_come_to_the_same_by_both_ways(seed, monkeypatch):
    chance = random.Random(seed)  # noqa: S311 - the same in every run
    short = 0
    for _ in range(ROUNDS // 4):
        parts = [*cut(chance, some_frames(chance)), COMMAND]  # a command follows any frames
        short += sum(small_text_frame(part) is not None for part in parts)
        with monkeypatch.context() as full:
            full.setattr(websocket, "small_text_frame", lambda _data: None)
            expected = End().outcome(parts)
        assert End().outcome(parts) == expected, parts
    assert short > ROUNDS // 8


def test_a_text_is_heard_at_once_only_while_none_waits():
    end = End()
    at_once = []
    takes = True

    def hear(text):
        at_once.append(text)
        return takes

    end.protocol.set_direct_receiver(hear)
    end.outcome([COMMAND])
    assert (at_once, end.heard) == ([DRIVE.decode()], [])
    end.heard.empty = lambda: False
    end.outcome([COMMAND])
    assert len(at_once) == len(end.heard) == 1
    del end.heard.empty
    takes = False
    end.outcome([COMMAND])
    assert len(at_once) == len(end.heard) == 2


def test_a_scope_offers_it_to_websockets(monkeypatch):
    scopes = []
    monkeypatch.setattr(
        "daphne.server.Server.create_application", lambda _self, _protocol, scope: scopes.append(scope)
    )
    server = Server.__new__(Server)
    protocol = SimpleNamespace(set_direct_receiver=print, send_directly=repr)
    server.create_application(protocol, {"type": "http"})
    server.create_application(protocol, {"type": "websocket"})
    assert scopes == [
        {"type": "http"},
        {
            "type": "websocket",
            "extensions": {websocket.DIRECT_RECEIVER: print, websocket.DIRECT_SENDER: repr},
        },
    ]
