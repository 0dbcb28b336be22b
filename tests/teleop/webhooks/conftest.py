"""A real receiver in this process, and webhooks that lead to it."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_network
from typing import Any

import pytest

from fleet.base.environment import WebhookAllow
from teleop.models import Webhook
from teleop.webhooks import services
from teleop.webhooks.events import EVENT_CATEGORIES
from tests.processes import serving

Heard = tuple[str, dict[str, str], bytes]  # path, headers, body


class Receiver(ThreadingHTTPServer):
    """Answers with the next status of `answers`, else 200; if `acts` is set, it runs instead."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.heard: list[Heard] = []
        self.answers: list[int] = []
        self.acts: Callable[[BaseHTTPRequestHandler], None] | None = None
        self.address = f"http://127.0.0.1:{self.server_port}/fleet?lab=1"


class _Handler(BaseHTTPRequestHandler):
    server: Receiver

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        headers = {name.lower(): value for name, value in self.headers.items()}
        self.server.heard.append((self.path, headers, body))
        if self.server.acts:
            self.server.acts(self)
            return
        self.send_response(self.server.answers.pop(0) if self.server.answers else 200)
        self.end_headers()
        self.wfile.write(b"heard")

    def log_message(self, *_args: Any) -> None:
        pass


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    server = Receiver()
    with serving(server):
        yield server


@pytest.fixture
def allowed(settings: Any) -> None:
    """Allow-list this computer's addresses."""
    settings.FLEET_WEBHOOK_ALLOW = WebhookAllow((ip_network("127.0.0.0/8"),))


@pytest.fixture
def make(staff: Any, allowed: None) -> Callable[..., Webhook]:
    """`make(address)`: a webhook for all kinds of events."""

    def made(address: str, name: str = "ci", **options: Any) -> Webhook:
        webhook, made.secret = services.webhook_make(
            name=name,
            address=address,
            kinds=options.pop("kinds", list(EVENT_CATEGORIES)),
            actor=staff,
            **options,
        )
        return webhook

    return made


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """`names["ci.example"] = ["10.0.0.1"]`: addresses of names for `getaddrinfo`."""
    known: dict[str, list[str]] = {}
    real = socket.getaddrinfo

    def resolve(host: str, port: int, *args: Any, **options: Any) -> Any:
        if host not in known:
            return real(host, port, *args, **options)
        return [found for address in known[host] for found in real(address, port, *args, **options)]

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    return known
