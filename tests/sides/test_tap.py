"""A tap: messages of any type, whole, in each form, for who comes early or late."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import cbor2
import pytest

from tests.processes import until
from tests.sides.side import Side
from tests.sides.visitor import Visitor
from tests.tap_process import Tap

STRING = "std_msgs/String"
SCAN = {
    "header": {"frame_id": "laser"},
    "angle_min": -1.5,
    "ranges": [0.5, math.inf, math.nan, 2.25],
    "intensities": [],
}


@pytest.fixture(scope="module")
def tap(side: Side, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tap]:
    process = Tap(side.config(tmp_path_factory.mktemp("tap")), side.environment())
    yield process
    process.stop()


@pytest.fixture
def latch(visitor: Visitor) -> Iterator[Callable[..., None]]:
    """``latch(topic, kind, **fields)`` publishes one message for all who come later."""
    with ExitStack() as ending:

        def publish(topic: str, kind: str, **fields: Any) -> None:
            speaker = ending.enter_context(visitor.speak(f"/{topic}", kind, listeners=0, kept=True))
            speaker.publish(**fields)

        yield publish


def test_json_has_all_fields_as_rosbridge_writes_them(
    side: Side, tap: Tap, latch: Callable[..., None]
) -> None:
    latch("scan_a", "sensor_msgs/LaserScan", **SCAN)
    latch("large", "std_msgs/Int64", data=2**62 + 1)
    latch("picture", "sensor_msgs/Image", height=1, width=3, encoding="rgb8", data=[0, 255, 128])
    tap.want(scan_a="json", large="json", picture="json")
    read = json.loads(tap.hears("scan_a"))
    assert read["ranges"] == [0.5, None, None, 2.25] and read["intensities"] == []
    assert read["header"]["frame_id"] == "laser"
    assert read["header"]["stamp"] == (
        {"secs": 0, "nsecs": 0} if side.number == 1 else {"sec": 0, "nanosec": 0}
    )
    assert json.loads(tap.hears("large")) == {"data": 2**62 + 1}
    assert base64.b64decode(json.loads(tap.hears("picture"))["data"]) == b"\x00\xff\x80"


def test_cbor_has_typed_arrays(tap: Tap, latch: Callable[..., None]) -> None:
    latch("scan_b", "sensor_msgs/LaserScan", **SCAN)
    latch("grid", "nav_msgs/OccupancyGrid", data=[-1, 0, 100])
    tap.want(scan_b="cbor", grid="cbor")
    ranges = cbor2.loads(tap.hears("scan_b", "cbor"))["ranges"]
    assert (ranges.tag, ranges.value) == (85, bytes.fromhex("0000003f 0000807f 0000c07f 00001040"))
    data = cbor2.loads(tap.hears("grid", "cbor"))["data"]
    assert (data.tag, data.value) == (72, b"\xff\x00\x64")


def test_a_topic_is_described_before_its_first_message(
    side: Side, tap: Tap, latch: Callable[..., None]
) -> None:
    """The reader must know the type to pass a message on."""
    latch("early", STRING, data="one")
    tap.want(early="json")
    tap.hears("early")
    assert tap.typed["/early"]
    state = tap.states["/early", None]
    assert (state.type, state.latched, state.refusal) == (side.type(STRING), True, None)
    assert "string data" in state.definition
    assert (
        state.md5 == "992ce8a1687cec8c8bd883ec73ca41d1"
        if side.number == 1
        else state.md5.startswith("RIHS01_")
    )


def test_who_comes_later_gets_messages_that_stay(side: Side, tap: Tap, latch: Callable[..., None]) -> None:
    latch("fixed", STRING, data="one")
    tap.want(fixed="json")
    assert json.loads(tap.hears("fixed")) == {"data": "one"}
    tap.messages.clear()
    tap.want(fixed="json raw")
    raw = b"\x03\0\0\0one" if side.number == 1 else b"\0\x01\0\0\x04\0\0\0one\0"
    assert tap.hears("fixed", "raw") == raw  # the publisher's bytes
    assert not tap.of("fixed", "json"), "the others have it"


def test_a_topic_without_publisher_is_refused_until_one_comes(
    side: Side, tap: Tap, latch: Callable[..., None]
) -> None:
    tap.want(nobody="json")
    tap.refuses("nobody", "no_publisher")
    latch("nobody", STRING, data="here")
    assert json.loads(tap.hears("nobody")) == {"data": "here"}
    until(lambda: tap.states["/nobody", None].type == side.type(STRING), "its state")
