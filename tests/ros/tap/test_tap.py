"""A tap with a real rosmaster: messages of any type, whole, in each form; bad publishers; the end."""

from __future__ import annotations

import asyncio
import base64
import json
import math
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import UUID

import cbor2
import pytest
import rospy
from msgspec.structs import replace
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import Image, LaserScan
from std_msgs.msg import Int64, String
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from robots.link import connections
from robots.link.client import BridgeLink
from robots.shared.configuration.bridge_config import LinkAddress
from script.stack.certificates import certificate_for
from teleop.tap.feed import TapFeed, TapMessage, TapReader
from tests.processes import PATIENCE_S, free_port, until
from tests.ros.bridge_support import running_bridge, tiago_config


@pytest.fixture
def latch() -> Iterator[Any]:
    """``latch(topic, message)`` publishes one message for all who come later."""
    publishers = []

    def publish(topic: str, message: Any, latched: bool = True) -> rospy.Publisher:
        publisher = rospy.Publisher(f"/{topic}", type(message), queue_size=10, latch=latched)
        publishers.append(publisher)
        publisher.publish(message)
        return publisher

    yield publish
    for publisher in publishers:
        publisher.unregister()


def scan() -> LaserScan:
    message = LaserScan(angle_min=-1.5, ranges=[0.5, math.inf, math.nan, 2.25], intensities=[])
    message.header.frame_id = "laser"
    return message


def test_json_is_as_rosbridge_writes_it(tap, latch):
    latch("scan_a", scan())
    latch("large", Int64(2**62 + 1))
    latch("picture", Image(height=1, width=3, encoding="rgb8", data=b"\x00\xff\x80"))
    tap.want(scan_a="json", large="json", picture="json")
    read = json.loads(tap.hears("scan_a"))
    assert read["ranges"] == [0.5, None, None, 2.25] and read["intensities"] == []
    assert read["header"]["frame_id"] == "laser" and read["header"]["stamp"] == {"secs": 0, "nsecs": 0}
    assert json.loads(tap.hears("large")) == {"data": 2**62 + 1}
    assert base64.b64decode(json.loads(tap.hears("picture"))["data"]) == b"\x00\xff\x80"


def test_cbor_has_typed_arrays_and_raw_the_publishers_bytes(tap, latch):
    latch("scan_b", scan())
    latch("grid", OccupancyGrid(data=[-1, 0, 100]))
    tap.want(scan_b="cbor raw", grid="cbor")
    ranges = cbor2.loads(tap.hears("scan_b", "cbor"))["ranges"]
    assert (ranges.tag, ranges.value) == (85, bytes.fromhex("0000003f 0000807f 0000c07f 00001040"))
    data = cbor2.loads(tap.hears("grid", "cbor"))["data"]
    assert (data.tag, data.value) == (72, b"\xff\x00\x64")
    assert LaserScan().deserialize(tap.hears("scan_b", "raw")).ranges[3] == 2.25


def test_a_topic_is_described(tap, latch):
    latch("word", String("hello"))
    tap.want(word="raw")
    until(lambda: tap.states.get(("/word", None)), "a state")
    state = tap.states["/word", None]
    assert (state.type, state.md5, state.latched) == ("std_msgs/String", String._md5sum, True)
    assert state.definition.strip() == "string data" and state.refusal is None


def test_a_topic_is_described_before_its_first_message(tap, latch):
    """The reader must know the type to pass a message on."""
    latch("early", String("one"))
    tap.want(early="json")
    tap.hears("early")
    assert tap.typed["/early"]


def test_who_comes_later_gets_latched_messages_of_every_publisher(tap, latch):
    latch("fixed", String("one"))
    tap.want(fixed="json")
    assert json.loads(tap.hears("fixed")) == {"data": "one"}
    tap.messages.clear()
    tap.want(fixed="json raw")
    assert tap.hears("fixed", "raw") == b"\x03\x00\x00\x00one"
    assert not tap.of("fixed", "json"), "the others have it"


def test_a_topic_without_publisher_is_refused_until_one_comes(tap, latch):
    tap.want(nobody="json")
    tap.refuses("nobody", "no_publisher")
    latch("nobody", String("here"))
    assert json.loads(tap.hears("nobody")) == {"data": "here"}
    until(lambda: tap.states["/nobody", None].type == "std_msgs/String", "its state")


@contextmanager
def bridge_host(rosmaster: Any, folder: Path) -> Iterator[tuple[UUID, LinkAddress]]:
    """A bridge that listens on the network, too; yields the address that a web process elsewhere has."""
    made = certificate_for(["127.0.0.1"], folder / "tls")
    address = LinkAddress(
        host="127.0.0.1",
        port=free_port(),
        certificate=str(made.certificate),
        private_key=str(made.private_key),
        secret="s3cret",
        authority=str(made.authority),
    )
    config = tiago_config(rosmaster, folder)
    config = replace(config, link=replace(address, unix_path=config.link.unix_path))
    with running_bridge(config, rosmaster, folder):
        yield UUID(config.robot_id), address


async def test_a_web_process_elsewhere_reads_over_tls_with_the_secret(
    rosmaster, ros, latch, tmp_path, monkeypatch
):
    """The bridge starts the tap and tells its port; host, secret and authority are those of the link."""

    async def not_here(path: str, **_: Any) -> None:
        raise FileNotFoundError(path)

    monkeypatch.setattr(connections, "unix_connect", not_here)
    picture = Image(height=1000, width=1000, encoding="mono8", data=bytes(range(250)) * 4000)
    latch("far", picture)
    with bridge_host(rosmaster, tmp_path) as (robot, address):
        link, arrived = BridgeLink(robot, address), asyncio.Queue()

        async def deliver(topic: str, form: str, message: TapMessage) -> None:
            arrived.put_nowait((topic, form, message))

        reader = TapReader(TapFeed(link), deliver, lambda _: None, lambda: False)
        assert reader.read("/far", "raw") is None
        topic, form, message = await asyncio.wait_for(arrived.get(), PATIENCE_S)
        assert (topic, form, Image().deserialize(message.body).data) == ("/far", "raw", picture.data)
        trusting = ssl.create_default_context(cafile=address.authority)
        with pytest.raises(InvalidStatus, match="401"):
            await connect(f"wss://127.0.0.1:{reader.feed._tap._at.port}/", ssl=trusting)
        reader.leave()
        await link.close()
