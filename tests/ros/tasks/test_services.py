"""Service calls over the console's own connection: another version is not called, a large answer is not read."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, cast

import pytest

from robots.bridge.ros.inspector import services
from robots.bridge.ros.network.tcpros import Conversation
from robots.bridge.topics.inspector import calls
from robots.bridge.topics.inspector.declined import Declined
from robots.shared.ros.master import Master
from robots.shared.ros.message_types.classes import service_class

TRIGGER = "std_srvs/Trigger"


class OneService:
    """A master with one service; `heard` has the calls that reached the service."""

    def __init__(self, uri: str) -> None:
        self._uri = uri
        self.heard: list[bytes] = []

    def call(self, _method: str, *_args: Any) -> str:
        return self._uri


@contextmanager
def serving(md5: str, answer: bytes = b"", pause_s: float = 0.0) -> Iterator[OneService]:
    """A service that sends this md5 sum. It answers every call with these bytes, with a pause after each byte.

    Yields its master.
    """
    pairs = [f"{key}={value}".encode() for key, value in {"type": TRIGGER, "md5sum": md5}.items()]
    header = b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)
    over = threading.Event()

    def serve() -> None:
        while True:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            with connection:
                asked = Conversation(connection, time.monotonic() + 10).read_header()
                connection.sendall(struct.pack("<I", len(header)) + header)
                if "probe" not in asked:
                    with suppress(OSError):  # the client stops waiting earlier
                        for byte in answer:
                            connection.sendall(bytes([byte]))
                            over.wait(pause_s)
                        master.heard.append(connection.recv(1024))

    with socket.create_server(("127.0.0.1", 0)) as listener:
        master = OneService(f"rosrpc://127.0.0.1:{listener.getsockname()[1]}")
        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield master
        over.set()
        listener.shutdown(socket.SHUT_RDWR)
        thread.join()


def test_a_service_of_another_version_is_not_called() -> None:
    with serving("0" * 32) as master, pytest.raises(Declined) as caught:
        services.find(cast(Master, master), "/lamp")
    assert caught.value.refusal.code == "definition_differs"
    assert caught.value.refusal.figures["robot_md5"] == "0" * 32


def test_an_answer_without_measure_is_not_read() -> None:
    size = calls.LARGEST_ANSWER + 1
    with serving(service_class(TRIGGER)._md5sum, b"\x01" + struct.pack("<I", size)) as master:
        service = services.find(cast(Master, master), "/lamp")
        with pytest.raises(Declined) as caught:
            calls.call(services.exchange, service, {}, lambda: None)
    assert caught.value.refusal.code == "service_lost"
    assert str(size) in caught.value.refusal.text


def test_a_call_that_is_late_by_then_is_not_sent() -> None:
    def too_late() -> None:
        raise Declined("too_old", "It is too late for it.")

    with serving(service_class(TRIGGER)._md5sum) as master:
        service = services.find(cast(Master, master), "/lamp")
        with pytest.raises(Declined) as caught:
            calls.call(services.exchange, service, {}, too_late)
    assert caught.value.refusal.code == "too_old"
    assert master.heard == [b""]  # the client connected, but sent nothing


def test_a_service_that_drips_its_answer_is_silent_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = b"\x01" + struct.pack("<I", 35) + struct.pack("<?I", True, 30) + b"x" * 30
    with serving(service_class(TRIGGER)._md5sum, answer, pause_s=0.2) as master:
        service = services.find(cast(Master, master), "/lamp")
        monkeypatch.setattr(services, "CALL_S", 1.0)
        with pytest.raises(Declined) as caught:
            calls.call(services.exchange, service, {}, lambda: None)
    assert caught.value.refusal.code == "service_silent"
