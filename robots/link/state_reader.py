"""Reads a robot's state and sends orders, for code without an event loop: REST, metrics, housekeeping.

A connection is kept open for the next question, because opening one takes ten times as long. The bridge sends only
answers on it, because the bridge reports by itself only after a hello.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from uuid import UUID

import msgspec
from msgspec import structs
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from robots.link.client import OTHER_PROTOCOL, require_robot
from robots.link.connections import LinkRefused, open_sync, why_down
from robots.link.stop_delivery import SILENT
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import BridgeFigures, Refused, State

ANSWER_S = 3.0  # from the first packet to the answer
MOST_KEPT = 2  # connections to one bridge
AT_ONCE = 16  # threads that ask all bridges for one reader; most of a bridge's answer is waiting

RecorderOrder = wire.LinkRecord | wire.LinkRecordEnd | wire.LinkKeep


class Connection:
    """An open connection to the bridge of a robot; `figures` are the bridge's counts from its hello."""

    def __init__(self, robot_id: UUID, address: LinkAddress, end_s: float) -> None:
        self.address = address
        with ExitStack() as stack:
            self._socket = stack.enter_context(open_sync(address))
            hello = self._socket.recv(timeout=max(end_s - time.monotonic(), 0.0))
            require_robot(hello, robot_id, address)
            greeting = wire.link_report(hello)
            if not isinstance(greeting, wire.BridgeHello) or greeting.protocol != wire.PROTOCOL:
                raise LinkRefused(OTHER_PROTOCOL)
            self.figures = greeting.figures
            self.close = stack.pop_all().close

    def ask(self, end_s: float) -> State:
        """Get the state. After an error the caller must close the connection, so that no late answer is read later."""
        self._socket.send(wire.encode(wire.LinkState()), text=True)
        return next(report.state for report in self._reports(end_s) if isinstance(report, wire.Status))

    def order(self, order: RecorderOrder, end_s: float) -> None:
        """Have it carried out. Raises LinkRefused."""
        self._socket.send(wire.encode(order), text=True)
        next(report for report in self._reports(end_s) if isinstance(report, wire.Accepted))

    def addresses(self, name: wire.ProcessName, end_s: float) -> Iterator[LinkAddress]:
        """Yield each address of a process beside the bridge, which runs while this connection is open."""
        self._socket.send(wire.encode(wire.LinkProcess(name, True)), text=True)
        for at in self._reports(end_s):
            if isinstance(at, wire.ProcessAt) and (at.unix_path or at.port):
                yield structs.replace(self.address, unix_path=at.unix_path, port=at.port)

    def _reports(self, end_s: float) -> Iterator[wire.LinkReport]:
        while True:
            report = wire.link_report(self._socket.recv(timeout=max(end_s - time.monotonic(), 0.0)))
            if isinstance(report, Refused):
                raise LinkRefused(report.refusal)
            yield report


_kept: defaultdict[UUID, list[Connection]] = defaultdict(list)


def state_once(robot_id: UUID, address: LinkAddress) -> State:
    """Get the robot's current state from its bridge. Raises LinkRefused, after `ANSWER_S` and the time to connect."""
    end_s = time.monotonic() + ANSWER_S
    kept = _kept[robot_id]
    with refused_in_words(address):
        while (connection := _taken(kept, address)) is not None:
            with suppress(ConnectionClosed):  # the bridge has ended since the last question
                return _ask_and_keep(connection, kept, end_s)
        return _ask_and_keep(Connection(robot_id, address, end_s), kept, end_s)


def figures_once(robot_id: UUID, address: LinkAddress) -> tuple[BridgeFigures | None, State]:
    """Get the bridge's counts (None: it has none) and the robot's state, by a new connection. Raises LinkRefused."""
    end_s = time.monotonic() + ANSWER_S
    with refused_in_words(address), closing(Connection(robot_id, address, end_s)) as connection:
        return connection.figures, connection.ask(end_s)


def order_once(robot_id: UUID, address: LinkAddress, order: RecorderOrder, within_s: float) -> None:
    """Have a request carried out, by a new connection. Raises LinkRefused, also without an answer in this time."""
    end_s = time.monotonic() + within_s
    with refused_in_words(address), closing(Connection(robot_id, address, end_s)) as connection:
        connection.order(order, end_s)


def _taken(kept: list[Connection], address: LinkAddress) -> Connection | None:
    """Take one of the kept connections, or None; close connections to an earlier address of the robot."""
    while kept:
        try:
            connection = kept.pop()
        except IndexError:  # another thread was quicker
            return None
        if connection.address == address:
            return connection
        connection.close()
    return None


def _ask_and_keep(connection: Connection, kept: list[Connection], end_s: float) -> State:
    try:
        state = connection.ask(end_s)
    except BaseException:
        connection.close()
        raise
    if len(kept) < MOST_KEPT:
        kept.append(connection)
    else:
        connection.close()
    return state


@contextmanager
def refused_in_words(address: LinkAddress) -> Iterator[None]:
    """Context: errors of a connection are raised as LinkRefused."""
    try:
        yield
    except msgspec.DecodeError as error:
        raise LinkRefused(OTHER_PROTOCOL) from error
    except TimeoutError as error:
        raise LinkRefused(SILENT) from error
    except (OSError, InvalidHandshake, ConnectionClosed) as error:
        raise LinkRefused(why_down(error, address)) from error
