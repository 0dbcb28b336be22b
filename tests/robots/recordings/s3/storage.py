"""An S3 server (moto, a process of its own) behind a proxy that counts requests, and breaks what a test wants."""

from __future__ import annotations

import http.client
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest

from fleet.base.environment import ObjectStore
from robots.recordings.s3.bucket import _client
from tests.processes import serving

SERVER = """
import logging, sys
logging.disable()
from moto.server import ThreadedMotoServer
server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
server.start()
print(*server.get_host_and_port(), flush=True)
sys.stdin.read()
"""
Fault = tuple[int, str] | None  # status and code of an answer; None: the server answers


class Request:
    """A request that came."""

    def __init__(self, method: str, target: str) -> None:
        parts = urlsplit(target)
        self.method, self.path = method, parts.path
        self.query = {name: value[0] for name, value in parse_qs(parts.query, keep_blank_values=True).items()}

    @property
    def part(self) -> int | None:
        """The number of the part that it sends."""
        number = self.query.get("partNumber") if self.method == "PUT" else None
        return int(number) if number else None


class Storage:
    """The store as the console sees it."""

    def __init__(self, moto: tuple[str, int], address: str) -> None:
        self._moto = moto
        self.requests: list[Request] = []
        self.fault: Callable[[Request], Fault] = lambda _: None
        self.store = ObjectStore(address, "bucket", "lab/", "us-east-1", "key", "s3cret")

    def reset(self) -> None:
        """Begin a test: an empty bucket, nothing broken."""
        self.fault = lambda _: None
        self.ask("create_bucket")
        for key in self.objects():
            self.ask("delete_object", Key=key)
        for upload in self.uploads():
            self.ask("abort_multipart_upload", **upload)
        self.requests.clear()

    def ask(self, operation: str, **parameters: Any) -> Any:
        return getattr(_client(self.store, 20.0), operation)(Bucket=self.store.bucket, **parameters)

    def objects(self) -> list[str]:
        return [one["Key"] for one in self.ask("list_objects_v2").get("Contents", [])]

    def uploads(self) -> list[dict[str, str]]:
        found = self.ask("list_multipart_uploads").get("Uploads", [])
        return [{"Key": one["Key"], "UploadId": one["UploadId"]} for one in found]

    @property
    def parts(self) -> list[int]:
        """The numbers of the parts that came."""
        return [part for request in self.requests if (part := request.part) is not None]

    def answer(self, handler: BaseHTTPRequestHandler) -> None:
        """Answer as the fault says, or as the server does."""
        length = int(handler.headers.get("Content-Length", 0))
        body = handler.rfile.read(length)
        if len(body) < length:  # the client was killed
            return
        self.requests.append(request := Request(handler.command, handler.path))
        if (fault := self.fault(request)) is not None:
            status, code = fault
            said = f"<Error><Code>{code}</Code><Message>On purpose</Message></Error>".encode()
            self._send(handler, status, [("Content-Type", "application/xml")], said)
            return
        passed = http.client.HTTPConnection(*self._moto, timeout=20)
        passed.request(handler.command, handler.path, body, dict(handler.headers.items()))
        answer = passed.getresponse()
        data = answer.read()
        passed.close()
        self._send(handler, answer.status, answer.getheaders(), data)

    def _send(
        self, handler: BaseHTTPRequestHandler, status: int, headers: list[tuple[str, str]], body: bytes
    ) -> None:
        handler.send_response(status)
        is_head = handler.command == "HEAD"
        for name, value in headers:
            if name.lower() not in ("connection", "transfer-encoding") and (
                is_head or name.lower() != "content-length"
            ):
                handler.send_header(name, value)
        if not is_head:
            handler.send_header("Content-Length", str(len(body)))
        handler.end_headers()
        if not is_head:
            handler.wfile.write(body)


@contextmanager
def storage() -> Iterator[Storage]:
    """A store for as long as the `with` block."""
    moto = subprocess.Popen(
        [sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert moto.stdout is not None
        host, port = moto.stdout.readline().split()
        proxy = _Proxy(("127.0.0.1", 0), _Handler)
        proxy.storage = Storage((host, int(port)), f"http://127.0.0.1:{proxy.server_address[1]}")
        with serving(proxy):
            proxy.storage.reset()
            yield proxy.storage
    finally:
        moto.kill()
        moto.communicate()


@pytest.fixture(scope="module")
def _storage() -> Iterator[Storage]:
    with storage() as made:
        yield made


@pytest.fixture
def s3(_storage: Storage) -> Storage:
    """An object store with an empty bucket."""
    _storage.reset()
    return _storage


class _Proxy(ThreadingHTTPServer):
    daemon_threads = True
    storage: Storage

    def handle_error(self, *_: Any) -> None:
        """Say nothing: clients are killed."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: _Proxy

    def answer(self) -> None:
        self.server.storage.answer(self)

    do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = answer

    def log_message(self, *_: Any) -> None:
        pass
