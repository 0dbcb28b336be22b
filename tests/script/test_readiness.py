"""script/serve asks its own web process whether it answers, and tells systemd."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from script.service.readiness import answers, tell_systemd
from script.stack.certificates import lan_addresses
from tests.processes import serving

ADDRESS = next(iter(lan_addresses()), "127.0.0.2")


class OnlyThisComputer(BaseHTTPRequestHandler):
    """Answers as a console behind a proxy on another computer."""

    status = 200

    def do_GET(self) -> None:
        admitted = self.client_address[0] == "127.0.0.1" and self.headers["Host"] == "fleet.lab.example"
        self.send_response(self.status if admitted and self.path == "/livez" else 403)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Print nothing."""


@contextmanager
def web_process(bind: str, status: int = 200) -> Iterator[int]:
    handler = type("Handler", (OnlyThisComputer,), {"status": status})
    server = HTTPServer((bind, 0), handler)
    with serving(server):
        yield server.server_port


@pytest.mark.parametrize("bind", ["127.0.0.1", "0.0.0.0", ADDRESS])  # noqa: S104
def test_a_web_process_answers_at_its_address(bind: str) -> None:
    with web_process(bind) as port:
        assert answers(bind, port, "fleet.lab.example", tls=False)
    assert not answers(bind, port, "fleet.lab.example", tls=False)


def test_one_that_is_not_ready_does_not_count() -> None:
    with web_process("127.0.0.1", status=503) as port:
        assert not answers("127.0.0.1", port, "fleet.lab.example", tls=False)


def test_systemd_hears_that_the_service_is_ready(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tell_systemd("nobody asks")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        tell_systemd("Serving on 127.0.0.1:8000.")
        assert systemd.recv(1000) == b"READY=1\nSTATUS=Serving on 127.0.0.1:8000."
