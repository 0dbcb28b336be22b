"""The sink of a bridge's records: it passes them to the records process of its computer, which knows the database."""

from __future__ import annotations

import socket
import time
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, cast

from robots.shared.records import calls
from robots.shared.records.record_sink import BadRecord, RecordError, RecordSink
from robots.shared.sentences import say

PATIENCE_S = 1.5  # a records process that starts with the bridge, or again, listens within this time
AGAIN_S = 0.05


def remote_sink(path: str, robot_id: str, robot_name: str) -> RecordSink:
    """Return a sink whose methods are those of the records process that listens at `path`.

    If that process is gone, they raise `RecordError`, and the next call waits for a new one, the calls after it do not
    wait. A process that died may have committed a record of which the bridge does not know: such a request is never
    carried out, and such an event is recorded twice.
    """
    return cast(RecordSink, _RemoteSink(path, calls.Opening(robot_id, robot_name)))


class _RemoteSink:
    def __init__(self, path: str, opening: calls.Opening) -> None:
        self._path = path
        self._opening = calls.encode(opening)
        self._connection: Connection | None = None
        self._patience_s = PATIENCE_S

    def __getattr__(self, method: str) -> Any:
        return partial(self._call, method)

    def _call(self, method: str, *arguments: Any) -> Any:
        """Call a method of the sink there; return or raise what it does."""
        call = calls.encode((method, arguments))
        try:
            if self._connection is None:
                self._connection = self._connected()
            self._connection.send_bytes(call)
            kind, value = calls.decode(self._connection.recv_bytes())
        except (OSError, EOFError) as error:
            if self._connection is not None:
                self._connection.close()
                self._connection = None
            raise RecordError(say("the process that writes the audit log does not run")) from error
        if kind == calls.DONE:
            return value
        raise BadRecord(value) if kind == calls.NEVER else RecordError(value)

    def _connected(self) -> Connection:
        until_s, self._patience_s = time.monotonic() + self._patience_s, 0.0
        with socket.socket(socket.AF_UNIX) as opened:
            while opened.connect_ex(self._path) and time.monotonic() < until_s:
                time.sleep(AGAIN_S)
            connection = calls.framed(opened)
        connection.send_bytes(self._opening)  # an OSError if it is not connected
        self._patience_s = PATIENCE_S
        return connection
