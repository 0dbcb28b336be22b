"""A console with people with and without rights, and watchdogs that receive their stops."""

import http.client
import os
import signal
import socket
import threading
from contextlib import ExitStack, contextmanager

import msgspec

from benchmarks.parts.process_stats import children
from robots.shared import wire
from tests.script.support import command_line


class Watchdog:
    """The stop socket of a robot: it stores the stops that it receives, and confirms them unless it is `silent`."""

    def __init__(self, path):
        self.heard = []
        self.silent = False
        self._path = path
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._server.bind(str(path))
        self._server.listen(1000)
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                connection, _ = self._server.accept()
            except OSError:
                return
            threading.Thread(target=self._answer, args=[connection], daemon=True).start()

    def _answer(self, connection):
        with connection:
            stop = msgspec.json.decode(connection.recv(65536), type=wire.LinkStop)
            self.heard.append(stop)
            if not self.silent:
                state = wire.StopState("stopping", stop.by, stop.reason)
                connection.send(wire.encode(wire.Stopped(state, stop.seq, stop.press)))
            connection.recv(1)  # until the console closes it

    def close(self):
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self._path.unlink(missing_ok=True)


class Crowd:
    """A console with people, and requests of them."""

    def __init__(self, web, people, watchdogs):
        self.web = web
        self.strangers, self.colleagues = people["strangers"], people["colleagues"]
        [self.presser] = people["presser"]
        self.watchdog, self.idle_watchdog, self.watchdog_apart = watchdogs

    def head(self, path, *lines, method="POST"):
        """A request without body, as bytes."""
        origin = f"Origin: http://127.0.0.1:{self.web.port}"
        first = [f"{method} {path} HTTP/1.1", f"Host: 127.0.0.1:{self.web.port}", origin, *lines]
        return "\r\n".join([*first, "Content-Length: 0", "", ""]).encode()

    def by_session(self, person, path="/api/v1/stop"):
        return self.head(path, f"Cookie: {person['cookie']}", f"X-CSRFToken: {person['csrf']}")

    def by_token(self, person, path="/api/v1/stop"):
        return self.head(path, f"Authorization: Bearer {person['token']}")

    def says(self, request):
        """Send a request on a new connection; return status and body."""
        with self.web.connect() as connection:
            connection.sendall(request)
            response = http.client.HTTPResponse(connection)
            response.begin()
            return response.status, response.read()

    @contextmanager
    def flood(self, requests, addresses=("127.0.0.1",)):
        """Send these requests at once, each on its own connection, and leave the connections open."""
        with ExitStack() as opened:
            connections = []
            for number, request in enumerate(requests):
                source = (addresses[number % len(addresses)], 0)
                connection = socket.create_connection(
                    ("127.0.0.1", self.web.port), timeout=30, source_address=source
                )
                connections.append(opened.enter_context(connection))
                connection.sendall(request)
            yield connections

    @contextmanager
    def pages_frozen(self):
        """The pages process hangs."""
        [frozen] = [pid for pid in children(self.web.child.pid) if "--life-line" in command_line(pid)]
        os.kill(frozen, signal.SIGSTOP)
        try:
            yield
        finally:
            os.kill(frozen, signal.SIGCONT)
