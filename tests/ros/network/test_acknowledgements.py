"""The kernel's unacknowledged bytes show how long the robot's machine takes. Needs no master."""

from __future__ import annotations

import socket
from types import SimpleNamespace

import pytest

from robots.bridge.ros.network.acknowledgements import Acknowledgements, _kept
from tests.processes import until


class Listener:
    """A subscriber of the topic at its own address."""

    def __init__(self, host):
        with socket.socket() as door:
            door.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            door.bind((host, 0))
            door.listen()
            ours = socket.create_connection(door.getsockname())
            self.theirs, _ = door.accept()
        ours.setblocking(False)
        self.connection = Connection(ours)

    def acknowledges(self):
        """Wait until the subscriber's kernel has acknowledged all bytes, some milliseconds."""
        until(lambda: _kept(self.connection) == 0, "an acknowledgement")

    def stalls(self):
        """Fill the subscriber's buffers, so that its computer accepts no more bytes."""
        while self.connection.write(4096):
            pass

    def close(self):
        self.theirs.close()
        if self.connection.socket is not None:
            self.connection.socket.close()


class Connection:
    """A connection with the fields of rospy's connections."""

    endpoint_id = "/robot"

    def __init__(self, ours):
        self.socket = ours
        self.stat_bytes = 0

    def write(self, size):
        try:
            written = self.socket.send(bytes(size))
        except BlockingIOError:
            return 0
        self.stat_bytes += written
        return written


@pytest.fixture
def listen():
    listeners = []

    def begin(host="127.0.0.1"):
        listeners.append(Listener(host))
        return listeners[-1]

    yield begin
    for listener in listeners:
        listener.close()


def topic(*listeners):
    return SimpleNamespace(impl=SimpleNamespace(connections=[listener.connection for listener in listeners]))


def test_an_immediate_acknowledgement_took_no_time(listen):
    robot, echoes = listen(), Acknowledgements("127.0.0.1")
    delays_s = []
    for period in range(5):
        delays_s.append(echoes.took_s(0.05 * period))
        robot.connection.write(52)
        echoes.wrote(topic(robot), 0.05 * period)
        robot.acknowledges()
    assert delays_s == [None, 0.0, 0.0, 0.0, 0.0]


def test_a_machine_that_takes_nothing_more_is_waited_for(listen):
    robot, echoes = listen(), Acknowledgements("127.0.0.1")
    robot.connection.write(52)
    echoes.wrote(topic(robot), 0.0)
    robot.acknowledges()
    assert echoes.took_s(0.05) == 0.0
    robot.stalls()
    echoes.wrote(topic(robot), 0.05)
    assert echoes.took_s(0.65) == pytest.approx(0.6)


def test_remote_viewers_are_not_awaited_remote_robots_are(listen):
    robot, reader, echoes = listen(), listen("127.0.0.2"), Acknowledgements("127.0.0.1")
    stalled = []

    def looked(now_s, *listeners):
        """Write to all connections; return the time that is reported 0.4 s later."""
        for listener in listeners:
            listener.connection.write(52)
        echoes.wrote(topic(*listeners), now_s)
        for listener in listeners:
            if listener not in stalled:
                listener.acknowledges()
        return echoes.took_s(now_s + 0.4)

    assert looked(1.0, reader) == 0.0
    reader.stalls()
    stalled.append(reader)
    assert looked(2.0, reader) == pytest.approx(0.4)
    assert looked(3.0, robot, reader) == 0.0


def test_a_connection_closed_by_rospy_no_longer_counts(listen):
    robot, echoes = listen(), Acknowledgements("127.0.0.1")
    robot.connection.write(52)
    echoes.wrote(topic(robot), 0.0)
    robot.connection.socket.close()
    robot.connection.socket = None
    assert echoes.took_s(0.05) == 0.0
    echoes.wrote(topic(robot), 0.05)
    assert echoes.took_s(0.1) == 0.0
    echoes.wrote(topic(), 0.1)
    assert echoes.took_s(0.2) is None
