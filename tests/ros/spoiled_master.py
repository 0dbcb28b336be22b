"""A proxy of a ROS master: a test can replace its answers."""

from __future__ import annotations

import copy
import http.client
import xmlrpc.client
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from tests.processes import serving
from tests.ros.support import Master

CUT_SHORT = b"<"  # part of an answer: the rest is missing when a master is killed
GONE = (OSError, http.client.HTTPException)  # errors of a master that has ended


def answer_of(value: object) -> bytes:
    """Return a master's answer: success, with this value."""
    return xmlrpc.client.dumps(([1, "", value],), methodresponse=True).encode()


class SpoiledMaster(Master):
    """The same master at another address. It gives the answers in `spoiled` instead of the real answers."""

    spoiled: dict[str, bytes]  # by method or argument
    given: list[str]  # keys of `spoiled` that were used, in order


@contextmanager
def spoiling(master: Master) -> Iterator[SpoiledMaster]:
    """Run the proxy for the length of a `with` block."""
    through: SpoiledMaster = copy.copy(master)  # type: ignore[assignment]
    through.spoiled, through.given = {}, []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            arguments, method = xmlrpc.client.loads(body.decode())
            asked = (str(argument) for argument in (method, *arguments))
            with suppress(*GONE):
                spoils = [what for what in asked if what in through.spoiled]
                through.given += spoils
                answer = through.spoiled[spoils[0]] if spoils else self._asked(body)
                self.send_response(200)
                self.send_header("Content-Length", str(len(answer)))
                self.end_headers()
                self.wfile.write(answer)

        def _asked(self, body: bytes) -> bytes:
            connection = http.client.HTTPConnection("127.0.0.1", master.port)
            try:
                connection.request("POST", "/RPC2", body, {"Content-Type": "text/xml"})
                return connection.getresponse().read()
            finally:
                connection.close()

        def log_message(self, *_: object) -> None: ...

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.block_on_close = False  # a node that monitors the master holds a connection
    through.uri = f"http://127.0.0.1:{server.server_port}/"
    with serving(server):
        yield through
