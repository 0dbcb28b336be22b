"""Bytes to a page are written at once, and stay in order when the kernel's buffer is full."""

import socket
from collections import deque

import daphne.server  # noqa: F401 - first: it chooses Twisted's reactor
import pytest
from twisted.internet.tcp import Connection

from fleet.server.websocket import WebSocketProtocol


class _Reactor:
    """Stores the transports that want to write."""

    def __init__(self):
        self.writers = set()

    def addWriter(self, writer):
        self.writers.add(writer)

    def removeWriter(self, writer):
        self.writers.discard(writer)

    def addReader(self, reader):
        pass

    removeReader = addReader


class _Traffic:
    outgoingOctetsWireLevel = 0


@pytest.fixture
def ends():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        for end in (ours, theirs):
            end.setblocking(False)
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        yield ours, theirs


@pytest.fixture
def page(ends):
    found = WebSocketProtocol()
    found.transport = Connection(ends[0], found, _Reactor())
    found.transport.connected = 1
    found.state, found.send_queue = found.STATE_OPEN, deque()
    found.logOctets, found.trafficStats = False, _Traffic()
    return found


def read(theirs, most=1_000_000):
    try:
        return theirs.recv(most)
    except BlockingIOError:
        return b""


def test_bytes_need_no_turn_of_the_loop(page, ends):
    page.sendData(b"news")
    assert read(ends[1]) == b"news"
    assert not page.transport.reactor.writers


def test_bytes_stay_in_order_when_the_kernel_takes_only_some(page, ends):
    got, written = b"", b""
    for number in range(300):
        message = b"%03d" % number + bytes([number % 256]) * (200 * (number % 37))
        page.sendData(message)
        written += message
        if number % 7 == 0:
            got += read(ends[1], 3000)
        if number % 11 == 0 and page.transport.reactor.writers:
            page.transport.doWrite()
    assert page.transport.reactor.writers, "more was written than the kernel takes"
    page.transport.loseConnection()
    page.sendData(b"the last word")  # closing must not reorder it
    while len(got) < len(written):
        page.transport.doWrite()
        got += read(ends[1])
    assert got == written + b"the last word"[: len(got) - len(written)]


def test_a_closed_page_is_noticed_and_breaks_nothing(page, ends):
    ends[1].close()
    page.sendData(b"news")
    assert page.transport.reactor.writers == {page.transport}
    assert isinstance(page.transport.doWrite(), Exception)
