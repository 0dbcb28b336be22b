"""The shipped files for nginx and Caddy: no secrets of links in logs, and another computer for one that is gone."""

from __future__ import annotations

import http.client
import shutil
import socket
import ssl
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path

import pytest

from script.stack.certificates import certificate_for
from script.stack.places import REPOSITORY
from script.stack.processes import Child, end_all
from script.stack.stack import Certificate
from tests.processes import free_port, outside, until
from tests.script.computers import listens

SECRET = "4sX9kq7-Zt_2vB8nQw"
STARTED_S = 20.0
SOON_S = 8.0  # the files try another computer after 2 s
CLIENTS = tuple(
    f"127.0.0.{number}" for number in range(11, 19)
)  # nginx chooses the computer by the client's address


@dataclass
class Proxy:
    """A running proxy."""

    port: int
    certificate: Certificate

    def asked(
        self, path: str, client: str = "127.0.0.1", patience_s: float = STARTED_S, **headers: str
    ) -> int:
        """Return the status of its answer. Raises `TimeoutError`."""
        trusting = ssl.create_default_context(cafile=self.certificate.authority)
        connection = http.client.HTTPSConnection(
            "localhost", self.port, context=trusting, timeout=patience_s, source_address=(client, 0)
        )
        try:
            connection.request("GET", path, headers=headers)
            return connection.getresponse().status
        finally:
            connection.close()


@pytest.fixture
def certificate(tmp_path: Path) -> Certificate:
    return certificate_for(["localhost"], tmp_path / "tls")


def shipped(name: str, changes: dict[str, str]) -> str:
    text = (REPOSITORY / "deploy" / name).read_text()
    for before, after in changes.items():
        assert before in text
        text = text.replace(before, after)
    return text


def nginx(port: int, computers: Sequence[str], certificate: Certificate, folder: Path) -> list[str]:
    """Write the files of nginx before these computers; return its command."""
    listening = {"listen 443 ": f"listen {port} ", "listen [::]:443 ": f"listen [::]:{port} "}
    unused = {"listen 80;": f"listen 127.0.0.1:{free_port()};", "listen [::]:80;": ""}
    line = "    server 127.0.0.1:8000 max_fails=1 fail_timeout=2s;"
    files = {
        "/etc/ssl/fleet.crt": str(certificate.certificate),
        "/etc/ssl/private/fleet.key": str(certificate.private_key),
        "/var/log/nginx/": f"{folder}/",
        "fleet.lab.example": "localhost",
        line: "\n".join(line.replace("127.0.0.1:8000", computer) for computer in computers),
    }
    (folder / "fleet.conf").write_text(shipped("nginx.conf", listening | unused | files))
    temporary = "".join(
        f"{kind}_temp_path {folder}/{kind};" for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    (folder / "nginx.conf").write_text(
        f"daemon off; pid {folder}/pid; error_log stderr; events {{}}\n"
        f"http {{ {temporary} include {folder}/fleet.conf; }}\n"
    )
    return ["nginx", "-p", str(folder), "-c", str(folder / "nginx.conf")]


def caddy(port: int, computers: Sequence[str], certificate: Certificate, folder: Path) -> list[str]:
    """Write the file of Caddy before these computers; return its command."""
    site = f"https://localhost:{port} {{\n\ttls {certificate.certificate} {certificate.private_key}"
    changes = {
        "unix//var/lib/caddy/admin.sock": f"unix/{folder}/admin.sock\n\tauto_https disable_redirects",
        "fleet.lab.example {": site,
        "127.0.0.1:8000": " ".join(computers),
    }
    (folder / "Caddyfile").write_text(shipped("Caddyfile", changes))
    return ["caddy", "run", "--config", str(folder / "Caddyfile"), "--adapter", "caddyfile"]


KINDS = [
    pytest.param(kind, marks=pytest.mark.skipif(shutil.which(kind.__name__) is None, reason="not installed"))
    for kind in (nginx, caddy)
]


@contextmanager
def running(
    kind: Callable[..., list[str]], computers: Sequence[str], certificate: Certificate, folder: Path
) -> Iterator[Proxy]:
    """Run a proxy before these computers."""
    port = free_port()
    command = kind(port, computers, certificate, folder)
    home = {name: str(folder) for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "HOME")}
    proxy = Child("proxy", command, env=outside() | home, log=folder / "log")
    try:
        until(lambda: listens(port) or not proxy.running, "the proxy listens", STARTED_S)
        yield Proxy(port, certificate)
    finally:
        end_all([proxy])


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_has_no_secret_of_a_link(
    kind: Callable[..., list[str]], certificate: Certificate, tmp_path: Path
) -> None:
    path = f"/join/{SECRET}/"
    with running(kind, [f"127.0.0.1:{free_port()}"], certificate, tmp_path) as proxy:
        assert proxy.asked(path, Referer=f"https://localhost{path}") == HTTPStatus.BAD_GATEWAY
    log = "".join(file.read_text() for file in tmp_path.glob("*log"))
    assert SECRET not in log
    assert kind is nginx or "connection refused" in log


@pytest.mark.parametrize("kind", KINDS)
def test_another_computer_answers_for_one_without_power(
    kind: Callable[..., list[str]], certificate: Certificate, tmp_path: Path
) -> None:
    with (
        silent() as gone,
        answering_once() as there,
        running(kind, [gone, there], certificate, tmp_path) as proxy,
    ):
        for client in CLIENTS:
            assert proxy.asked("/", client, SOON_S) == HTTPStatus.OK


@contextmanager
def silent() -> Iterator[str]:
    """Yield an address at which packets of new connections get no answer: its queue is full."""
    with socket.create_server(("127.0.0.1", 0), backlog=0) as server, ExitStack() as stack:
        for _ in range(3):
            waiting = stack.enter_context(socket.socket())
            waiting.setblocking(False)
            with suppress(BlockingIOError):
                waiting.connect(server.getsockname())
        yield f"127.0.0.1:{server.getsockname()[1]}"


@contextmanager
def answering_once() -> Iterator[str]:
    """Yield the address of a server that answers once on each connection, as one that loses its power afterwards."""
    kept: list[socket.socket] = []

    def serve() -> None:
        with suppress(OSError):  # the server is closed
            while True:
                connection, _ = server.accept()
                kept.append(connection)
                connection.recv(65536)
                connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nOK")

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=serve)
        thread.start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
        thread.join()
    for connection in kept:
        connection.close()
