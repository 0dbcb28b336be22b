"""Serves the sinks of all bridges of this computer: a thread and a connection to the database for each bridge."""

from __future__ import annotations

import logging
import socket
import threading
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from os.path import samestat
from pathlib import Path
from typing import Any
from uuid import UUID

import msgspec
from django.db import connection

from robots.records.bridge_records import AuditSink
from robots.shared.records import calls
from robots.shared.records.record_sink import BadRecord, RecordError
from robots.shared.sentences import reason_of, say

CHECK_S = 0.05

log = logging.getLogger(__name__)


def serve(path: Path, ended: threading.Event) -> None:
    """Serve at this Unix socket until `ended`, and then until no bridge is connected: each records its end."""
    path.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        own = path.stat()
        listener.listen()
        bridges: list[threading.Thread] = []
        threading.Thread(target=_accept, args=(listener, bridges), name="accept", daemon=True).start()
        ended.wait()
        while any(bridge.is_alive() for bridge in bridges):
            time.sleep(CHECK_S)
        with suppress(FileNotFoundError):
            if samestat(own, path.stat()):  # a successor may have its own there
                path.unlink()


def _accept(listener: socket.socket, bridges: list[threading.Thread]) -> None:
    while True:
        try:
            accepted, _ = listener.accept()
        except OSError:  # `serve` has closed it
            return
        bridge = threading.Thread(target=_serve_bridge, args=(calls.framed(accepted),), daemon=True)
        bridges[:] = [*(one for one in bridges if one.is_alive()), bridge]
        bridge.start()


def _serve_bridge(bridge: Connection) -> None:
    """Answer the calls of one bridge, one at a time and in order."""
    try:
        with bridge:
            whose = calls.opening(bridge.recv_bytes())
            sink = AuditSink(UUID(whose.robot_id), whose.robot_name)
            while True:
                bridge.send_bytes(calls.encode(_answer(sink, bridge.recv_bytes())))
    except (EOFError, OSError):
        pass  # the bridge ended
    except (msgspec.DecodeError, ValueError):
        log.exception("the first message is not a bridge's")
    finally:
        connection.close()


def _answer(sink: AuditSink, call: bytes) -> tuple[str, Any]:
    try:
        method, arguments = calls.call_of(call)
        return calls.DONE, getattr(sink, method)(*arguments)
    except RecordError as error:
        return calls.NEVER if isinstance(error, BadRecord) else calls.NOT_NOW, reason_of(error)
    except Exception:
        log.exception("a record failed")
        return calls.NEVER, say("the audit log refuses this record")
