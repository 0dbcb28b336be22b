"""tf for clients: the tree of frames, and what is sent of it."""

from __future__ import annotations

import math
import time

import msgspec
import pytest

from robots.shared import wire
from teleop.rosbridge.tf import republisher
from teleop.rosbridge.tf.republisher import Transforms
from teleop.rosbridge.tf.tree import TfMessage, Transform, Tree, inverse, moved
from teleop.tap.feed import TapMessage

HALF = math.sqrt(0.5)


def tf(*steps: tuple[str, str, tuple[float, float, float], float]) -> bytes:
    """A message with transforms: parent, child, translation, yaw."""
    transforms = [
        {
            "header": {"seq": 1, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": parent},
            "child_frame_id": child,
            "transform": {
                "translation": dict(zip("xyz", at, strict=True)),
                "rotation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)},
            },
        }
        for parent, child, at, yaw in steps
    ]
    return msgspec.json.encode({"transforms": transforms})


@pytest.fixture
def tree() -> Tree:
    tree = Tree()
    message = tf(
        ("map", "odom", (1, 0, 0), math.pi / 2),
        ("/odom", "/base", (2, 0, 0), 0.0),
        ("base", "laser", (0.2, 0, 0.1), 0.0),
    )
    tree.take(msgspec.json.decode(message, type=TfMessage))
    return tree


def place(found: Transform | None) -> tuple[float, float, float]:
    assert found is not None
    return found.translation.x, found.translation.y, found.translation.z


def test_a_frame_is_found_up_down_and_across_the_tree(tree):
    assert place(tree.find("map", "laser")) == pytest.approx((1.0, 2.2, 0.1))
    assert place(tree.find("laser", "laser")) == (0.0, 0.0, 0.0)
    assert place(tree.find("base", "map")) == pytest.approx((-2.0, 1.0, 0.0))
    assert place(tree.find("/laser", "odom")) == pytest.approx((-2.2, 0.0, -0.1))
    assert tree.find("map", "nothing") is None


def test_a_loop_of_frames_ends(tree):
    tree.take(msgspec.json.decode(tf(("laser", "map", (0, 0, 0), 0.0)), type=TfMessage))
    assert tree.find("map", "nothing") is None
    assert tree.find("map", "base") is not None


def test_a_difference_has_distance_and_angle(tree):
    there = tree.find("map", "base")
    assert moved(there, there) == pytest.approx((0.0, 0.0))
    assert moved(Transform(), there) == pytest.approx((math.hypot(1, 2), math.pi / 2))
    assert moved(there, inverse(there)).angle_rad == pytest.approx(math.pi)


# --- through the door ------------------------------------------------------------------------------------------

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def robot_tf(monkeypatch):
    """`await robot_tf(bytes)`: the robot publishes on /tf."""
    families: list[Transforms] = []
    begin = Transforms._begin

    def noted(self, *given):
        families.append(self)
        begin(self, *given)

    monkeypatch.setattr(Transforms, "_begin", noted)

    async def publish(body: bytes) -> None:
        await families[-1]._deliver("/tf", "json", TapMessage("/tf", 1, 0, body))

    return publish


WANTED = {
    "source_frames": ["base"],
    "target_frame": "odom",
    "trans_thres": 0.1,
    "angular_thres": 2,
    "rate": 50,
}


async def test_a_client_gets_transforms_on_a_topic(open_client, bridge, robot_tf):
    client = await open_client("observer", scopes=("topics",))
    answer = await client.call("/republish_tfs", **WANTED)
    topic = answer["values"]["topic_name"]
    await robot_tf(tf(("odom", "base", (1.0, 0, 0), 0.0)))  # nobody listens yet
    await client.send("subscribe", topic=topic, type="tf2_web_republisher/TFArray")
    for x in (1.0, 1.05, 1.2):  # the second has hardly moved
        await robot_tf(tf(("odom", "base", (x, 0, 0), 0.0)))
        if x != 1.05:
            (sent,) = (await client.hears_op("publish", topic=topic))["msg"]["transforms"]
            assert sent["transform"]["translation"]["x"] == x
            assert (sent["header"]["frame_id"], sent["child_frame_id"]) == ("odom", "base")


async def test_a_client_gets_transforms_as_feedback_until_it_cancels(open_client, bridge, robot_tf):
    client = await open_client("operator")
    await client.send("subscribe", topic="/tf2_web_republisher/feedback")
    await client.send(
        "publish", topic="/tf2_web_republisher/goal", msg={"goal_id": {"id": "g1"}, "goal": WANTED}
    )
    await client.call("/republish_tfs", **WANTED)
    await robot_tf(tf(("odom", "base", (1, 0, 0), 0.0)))
    heard = (await client.hears_op("publish", topic="/tf2_web_republisher/feedback"))["msg"]
    assert heard["status"]["goal_id"]["id"] == "g1"
    assert heard["feedback"]["transforms"][0]["child_frame_id"] == "base"
    await client.send("publish", topic="/tf2_web_republisher/cancel", msg={"id": "g1"})


@pytest.mark.parametrize(
    "wrong", [{"source_frames": "base"}, {"rate": "fast"}, {"source_frames": ["x"] * 201}]
)
async def test_a_wrong_request_for_transforms_is_refused(wrong, open_client, bridge):
    client = await open_client("operator")
    assert (await client.call("/republish_tfs", **wrong))["values"].startswith("invalid: ")


async def test_requests_for_transforms_are_limited(open_client, bridge, monkeypatch):
    monkeypatch.setattr(republisher, "MOST_ASKED", 1)
    client = await open_client("operator")
    assert (await client.call("/republish_tfs"))["result"]
    assert (await client.call("/republish_tfs"))["values"].startswith("busy: ")
    assert not bridge.all(wire.LinkQuery)


async def test_frames_found_for_one_client_are_limited(open_client, bridge, robot_tf, monkeypatch):
    monkeypatch.setattr(republisher, "FRAMES_PER_S", 0.01)
    begun = []
    begin = Transforms._begin
    monkeypatch.setattr(Transforms, "_begin", lambda self, *given: (begin(self, *given), begun.append(self)))
    client = await open_client("operator")
    topic = (await client.call("/republish_tfs", **WANTED))["values"]["topic_name"]
    await client.send("subscribe", topic=topic)
    (asked,) = begun[0]._asked.values()
    await client.call("/fleet/renew_control")  # meanwhile it was looked at once
    assert asked.due_s - time.monotonic() > 50.0  # not a fiftieth of a second
