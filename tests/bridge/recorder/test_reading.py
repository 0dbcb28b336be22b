"""Which topics a recording of everything reads, and which of their messages never came."""

from __future__ import annotations

import pytest

from robots.bridge.recorder.reading import Reading
from robots.bridge.recorder.recorder import Wanted
from robots.bridge.tap.arrivals import Kind
from robots.bridge.tap.raw_topic import Speaker
from robots.shared.graph import SystemState
from robots.shared.messages.definition import Definition
from robots.shared.messages.packing import HEADER
from robots.shared.wire import Field

TOPICS = [f"/topic_{number}" for number in range(330)]


class Side:
    """A robot with 330 topics, of which 20 are pictures."""

    encoding = "ros1"

    def listen(self, topic, take, *, thins):
        self.take = take

    def survey(self) -> SystemState:
        types = dict.fromkeys(TOPICS, "std_msgs/String") | dict.fromkeys(TOPICS[:20], "sensor_msgs/Image")
        return SystemState({topic: ["/node"] for topic in TOPICS}, {}, types, {})


class Taker:
    """Takes messages, and hears how many are left out or missed."""

    def __init__(self) -> None:
        self.left: list[int] = []
        self.lost: list[int] = []
        self.messages: list[bytes] = []

    def left_out(self, count: int) -> None:
        self.left.append(count)

    def missed(self, origin, count: int) -> None:
        self.lost.append(count)

    def arrived(self, message) -> None:
        self.messages.append(message.data)


def test_the_taker_hears_how_many_are_left_out() -> None:
    taker = Taker()
    everything = Reading(Side(), taker)._others(Wanted({"/chosen": 0.0}, "all"))
    assert len(everything) == 299 and "/topic_0" not in everything  # a picture
    Reading(Side(), taker)._others(Wanted({}, "contacts"))
    assert taker.left == [31, 0]


@pytest.mark.parametrize(("first", "lost"), [("seq", [2]), ("stamp", [])], ids=["ROS 1", "ROS 2"])
def test_messages_that_a_publisher_numbers_are_missed(first: str, lost: list[int]) -> None:
    side, taker = Side(), Taker()
    Reading(side, taker)._read({"/odom": 0.0})

    header = Field("header", HEADER, fields=[Field(first, "uint32")])
    definition = Definition("nav_msgs/Odometry", "", "", True, [header])
    speaker = Speaker("/base", Kind("nav_msgs/Odometry", ""), False, "", definition, None)
    for number in (7, 8, 11):
        side.take(speaker, number.to_bytes(4, "little") + b"pose")
    assert len(taker.messages) == 3 and taker.lost == lost
