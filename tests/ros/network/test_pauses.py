"""Pauses between reads of a publisher, and what a read after a pause keeps."""

from __future__ import annotations

import io
import socket
import struct
import threading
from types import SimpleNamespace

import pytest
from rospy.msg import deserialize_messages
from std_msgs.msg import String

from robots.bridge.ros.bounds import listening
from robots.bridge.ros.bounds.listening import Listening, hurry, pause

TOPIC = "/paused"


@pytest.fixture
def connection():
    ours, theirs = socket.socketpair()
    found = Listening(TOPIC, String, queue_size=5)
    found.transport = SimpleNamespace(socket=ours)
    yield found
    hurry(False)
    del listening._pauses[TOPIC]
    ours.close()
    theirs.close()


def read(connection, *texts):
    came, found = io.BytesIO(), []
    for text in texts:
        came.write(struct.pack("<II", len(text) + 4, len(text)) + text.encode())
    connection.read_messages(came, found, None)
    return [message.data for message in found]


def rests(connection, seconds=10.0):
    """Return a thread that pauses."""
    thread = threading.Thread(target=connection.rest, daemon=True)
    thread.start()
    thread.join(seconds)
    return thread


def test_the_first_read_comes_at_once(connection):
    pause(TOPIC, lambda: 60.0)
    assert not rests(connection).is_alive()


def test_control_ends_a_pause_and_all_messages_are_read(connection):
    pause(TOPIC, lambda: 60.0, hurried_s=0.0, newest_only=True)
    read(connection, "before")
    thread = rests(connection, 0.05)
    assert thread.is_alive()
    hurry(True)
    thread.join(10.0)
    assert not thread.is_alive()
    assert read(connection, "a", "b", "c") == ["a", "b", "c"]
    assert not rests(connection).is_alive(), "no other pause begins"


def test_a_read_after_a_pause_takes_the_newest_message_for_all(connection):
    pause(TOPIC, lambda: 0.001, hurried_s=0.0, newest_only=True)
    read(connection, "before")
    connection.rest()
    assert read(connection, "a", "b", "c") == ["c"]
    assert connection.stands_for == 3
    assert read(connection, "d", "e") == ["e"]


def test_after_a_silence_no_message_is_missing(connection, monkeypatch):
    monkeypatch.setattr(listening, "NEWEST_WITHIN_S", -1.0)
    pause(TOPIC, lambda: 0.001, hurried_s=0.0, newest_only=True)
    read(connection, "before")
    connection.rest()
    assert read(connection, "a", "b", "c") == ["a", "b", "c"]
    assert connection.stands_for == 1


def test_a_buffer_that_was_emptied_holds_what_comes_next():
    buffer, found = listening._Buffer(), []
    for text in ("a long text", "b"):
        buffer.write(struct.pack("<II", len(text) + 4, len(text)) + text.encode())
        buffer.write(b"\x05\x00")  # the begin of the next message
        deserialize_messages(buffer, found, String)
        assert buffer.tell() == 2
        buffer.seek(0)
    assert [message.data for message in found] == ["a long text", "b"]
    buffer.write(bytes(listening.KEPT_BYTES + 1))
    buffer.seek(0)
    buffer.truncate(0)
    assert not buffer.getvalue(), "the memory of a huge message is given back"
