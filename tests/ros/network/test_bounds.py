"""Limits for data from the robot's network: texts, tables, messages, time of the event loop, connections."""

from __future__ import annotations

import http.client
import ipaddress
import itertools
import logging
import socket
import struct
import threading
import xmlrpc.client
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import MethodType, SimpleNamespace

import pytest

import robots.bridge.ros.bounds.servers as doors
from robots.bridge.ros.bounds.listening import Reading
from robots.bridge.ros.bounds.logs import BURST, LogLimiter
from robots.bridge.ros.bounds.sizes import Kind, kind_of
from robots.bridge.ros.tasks.publishing import _AtOnce
from robots.shared import texts
from robots.shared.ros.master import Master, MasterError, _Transport
from tests.processes import serving
from tests.ros import strangers
from tests.ros.network.test_hostile_nodes import answering
from tests.ros.spoiled_master import answer_of

LONG = "n" * 1_000_000


# --- texts and tables ------------------------------------------------------------------------------


def test_a_text_is_cut_and_shows_it():
    assert texts.cut("short", 5) == "short"
    assert texts.cut("too long", 5) == "too …"


def test_every_text_of_a_masters_answer_is_cut_as_it_comes():
    with answering(answer_of([[["/key_vel", [f"/{LONG}"]]], [], []])) as uri:
        [[_, [node]]], _, _ = Master(uri, "/test").call("getSystemState")
    assert len(node) == texts.ANSWER


def test_an_answer_like_the_one_before_is_not_read_again(monkeypatch):
    answers = [answer_of([[["/key_vel", ["/mux"]]], [], []]), answer_of([[["/key_vel", ["/other"]]], [], []])]
    read = []
    whole = _Transport.getparser
    monkeypatch.setattr(_Transport, "getparser", lambda transport: read.append(1) or whole(transport))
    with answering(answers[0]) as first, answering(answers[1]) as second:
        master = Master(first, "/test")
        found = [master.call("getSystemState") for _ in range(3)]
        master.uri = second
        found.append(master.call("getSystemState"))
    assert [nodes[0][0][1] for nodes in found] == [["/mux"]] * 3 + [["/other"]]
    assert len(read) == 2


def test_a_robots_description_is_not_cut():
    with answering(answer_of(LONG)) as uri:
        assert Master(uri, "/test").parameter("/robot_description") == LONG


def test_an_error_of_a_masters_is_a_sentence():
    answer = xmlrpc.client.dumps(([0, LONG, 0],), methodresponse=True).encode()
    with answering(answer) as uri, pytest.raises(MasterError) as caught:
        Master(uri, "/test").alive()
    assert len(str(caught.value)) == texts.SENTENCE


def test_an_answer_with_too_many_values_is_none():
    with answering(answer_of([[]] * 600_000)) as uri, pytest.raises(MasterError, match="too many values"):
        Master(uri, "/test").alive()


def test_an_answer_without_end_is_none(monkeypatch):
    monkeypatch.setattr("robots.shared.ros.master.LARGEST_ANSWER", 100_000)
    with answering(answer_of(LONG)) as uri, pytest.raises(MasterError, match="more than 100000 bytes"):
        Master(uri, "/test").alive()


def test_a_page_counts_names_beyond_its_limit():
    assert texts.named([f"/node_{number:02}" for number in range(12)])[-2:] == ["/node_09", "+2"]


def test_our_goals_are_kept_when_there_are_too_many():
    goals = {**{f"other-{number}": 1 for number in range(500)}, "ours-1": 1}
    kept = texts.most_of(goals, "ours-")
    assert len(kept) == texts.MOST_GOALS
    assert "ours-1" in kept


# --- publishers --------------------------------------------------------------------------------------


def test_a_message_is_too_large_before_it_has_come():
    reading = Reading(Kind(most_bytes=1000))
    assert reading.why_not(1000, 1, 0.0, 0.0) == ""
    assert reading.why_not(12_000_000, 0, 0.0, 0.0) == "sends messages of 12 MB, at most 1 kB is taken"


def test_a_laser_may_have_as_many_beams_as_the_gate_takes():
    kind = kind_of("/scan", "sensor_msgs/LaserScan")
    assert kind.most_bytes > len(strangers.scan(1, 20_000))
    assert kind.most_bytes < len(strangers.scan(1, 50_000))


def test_ten_thousand_messages_a_second_are_too_many():
    reading = Reading(Kind(most_hz=1000.0))
    assert reading.why_not(10, 1500, 0.0, 0.0) == ""  # these messages waited while the network paused
    seconds = itertools.count(1)
    assert all(reading.why_not(10, 1000, 0.0, float(next(seconds))) == "" for _ in range(5))
    whys = [reading.why_not(10, 1000, 0.0, 6.0 + number / 10) for number in range(5)]
    assert "sends more than 1000 messages a second" in whys


def test_reading_that_takes_too_much_of_a_processor_ends():
    reading = Reading(Kind(share=0.25))
    assert all(reading.why_not(10, 1, 0.02, number / 10) == "" for number in range(100))
    whys = [reading.why_not(10, 1, 0.09, 10.0 + number / 10) for number in range(20)]
    assert "takes more than 25% of a processor" in whys


# --- servers and callers -------------------------------------------------------------------------------


def test_ports_use_the_local_advertised_address_or_all(monkeypatch):
    monkeypatch.delenv("ROS_IP", raising=False)
    everywhere = str(ipaddress.IPv4Address(0))
    monkeypatch.setenv("ROS_HOSTNAME", "127.0.0.3")
    assert doors.bind_address() == "127.0.0.3"
    addresses = {"another-computer": "192.0.2.1", "our-console": "127.0.1.1"}  # as in /etc/hosts of Debian
    monkeypatch.setattr(socket, "gethostbyname", addresses.__getitem__)
    for name in addresses:
        monkeypatch.setenv("ROS_HOSTNAME", name)
        assert doors.bind_address() == everywhere


@contextmanager
def call_server() -> Iterator[doors.Server]:
    server = doors.Server(("127.0.0.1", 0))
    server.register_function(lambda *_: (1, "", 7), "getPid")
    with serving(server):
        yield server


def test_a_call_with_a_body_of_4_gb_is_refused_at_its_header():
    with call_server() as server:
        connection = http.client.HTTPConnection(*server.server_address, timeout=10)
        connection.putrequest("POST", "/RPC2")
        connection.putheader("Content-Length", "4294967295")
        connection.endheaders()
        assert connection.getresponse().status == 413
        connection.close()


def test_silent_callers_lock_no_other_out():
    with call_server() as server:
        silent = [socket.create_connection(server.server_address) for _ in range(2 * doors.MOST_CALLERS)]
        with xmlrpc.client.ServerProxy("http://{}:{}/".format(*server.server_address)) as proxy:
            assert proxy.getPid("/test") == [1, "", 7]
        for connection in silent:
            connection.close()


def test_an_address_that_calls_without_pause_is_not_served():
    callers = doors.CallerLimits(4)
    assert sum(callers.allow("10.0.0.1", 0.0) for _ in range(1000)) == doors.BURST
    assert callers.allow("10.0.0.2", 0.0)


def test_a_call_refused_for_its_rate_makes_the_bridge_ask_master(monkeypatch):
    monkeypatch.setattr(doors, "CALL_REFUSED", threading.Event())
    monkeypatch.setattr(doors, "BURST", 2.0)  # one connection and one call
    monkeypatch.setattr(doors, "PER_S", 0.001)  # none is added while a busy computer is slow
    with (
        call_server() as server,
        xmlrpc.client.ServerProxy("http://{}:{}/".format(*server.server_address)) as proxy,
    ):
        proxy.getPid("/test")
        assert not doors.CALL_REFUSED.is_set()
        with pytest.raises(xmlrpc.client.ProtocolError):
            proxy.getPid("/test")
    assert doors.CALL_REFUSED.is_set()


def test_static_transforms_and_logs_may_have_a_node_each():
    assert kind_of("/tf_static", "tf2_msgs/TFMessage").publishers >= 50
    assert kind_of("/rosout", "*").publishers >= 50


class _Topics:
    """A TCPROS server like rospy's that accepts every connection."""

    def __init__(self) -> None:
        self.taken: list[dict[str, str]] = []
        self.came = threading.Event()

    def topic_connection_handler(self, connection, address, header):
        self.taken.append(header)
        self.came.set()


def test_a_listener_that_declares_4_gb_delays_no_other():
    topics, ours = _Topics(), []
    for said in (b"", struct.pack("<I", 0xFFFFFFFF) + bytes(100_000)):
        near, far = socket.socketpair()
        far.sendall(said)
        doors.take_connection(topics, near, ("127.0.0.1", 1))
        ours.append(far)
    near, far = socket.socketpair()
    far.sendall(strangers.header({"topic": "/key_vel", "callerid": LONG[:1000], "md5sum": "*"}))
    doors.take_connection(topics, near, ("127.0.0.1", 2))
    assert topics.came.wait(10)
    assert len(topics.taken[0]["callerid"]) == texts.NAME
    ours[1].settimeout(10)
    with suppress(ConnectionResetError):
        assert ours[1].recv(1) == b""  # the connection with 4 GB is cut off
    for connection in (*ours, near, far):
        connection.close()


def test_strangers_fill_no_log():
    sparing = LogLimiter()
    record = logging.LogRecord("rospy.internal", logging.WARNING, "", 0, LONG, (), None)
    passed = [sparing.filter(record) for _ in range(1000)]
    assert BURST <= sum(passed) < 2 * BURST
    assert len(record.msg) < 5000
    own = logging.LogRecord("robots.bridge", logging.WARNING, "", 0, "ours", (), None)
    assert sparing.filter(own)


# --- listeners ---------------------------------------------------------------------------------------


def test_more_unread_listeners_do_not_wait_longer():
    with socket.create_server(("127.0.0.1", 0)) as server:
        ends = [socket.create_connection(server.getsockname()) for _ in range(5)]
        topic = SimpleNamespace(connections=[SimpleNamespace(socket=end) for end in ends])
        publish = MethodType(lambda *_: None, topic)
        immediate = _AtOnce(0.02)
        immediate.peer_subscribe("/key_vel", publish, publish)
        patience_s = sum(
            seconds + microseconds / 1e6
            for end in ends
            for seconds, microseconds in [
                struct.unpack("@ll", end.getsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, 16))
            ]
        )
        for end in ends:
            end.close()
    assert 0.0 < patience_s < 0.03  # the kernel's clock has steps of some milliseconds


def test_the_number_of_listeners_is_limited(monkeypatch):
    crowd = SimpleNamespace(connections=[object()] * doors.MOST_LISTENERS)
    monkeypatch.setattr(
        doors, "get_topic_manager", lambda: SimpleNamespace(get_publisher_impl=lambda _: crowd)
    )
    assert doors._why_full({"topic": "/key_vel"}) == f"more than {doors.MOST_LISTENERS} listen already"
    crowd.connections.pop()
    assert doors._why_full({"topic": "/key_vel"}) == ""
    assert doors._why_full({"service": "/set_logger_level"}) == "only topics are here"
