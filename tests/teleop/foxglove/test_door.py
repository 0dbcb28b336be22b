"""The Foxglove door: channels, subscriptions, parameters, the connection graph, and what it refuses."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import msgspec
import pytest
from django.utils import timezone
from msgspec import structs

from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from fleet.audit.models import Record
from robots.registry.models import RobotRole
from robots.shared import wire
from robots.shared.messages.serialization import CDR
from robots.shared.wire import TapState
from teleop.background.database import in_database
from teleop.foxglove import catalogue, consumer
from teleop.live.consumers.message_socket import CloseCode
from teleop.tap.feed import TapMessage
from tests.teleop.support import Page, eventually

pytestmark = pytest.mark.django_db(transaction=True)

SCAN = "float32[] ranges\n"
ODOM = wire.TopicRow("/odom", "nav_msgs/Odometry", ["/base"], ["/gate"])
ROWS = [
    ODOM,
    wire.TopicRow("/scan", "sensor_msgs/LaserScan", ["/laser"]),
    wire.TopicRow("/picture", "sensor_msgs/CompressedImage", ["/camera"]),
    wire.TopicRow("/own", "lab_msgs/Own", ["/node"]),
    wire.TopicRow("/heard", "std_msgs/String", [], ["/tts"]),
    wire.TopicRow("/unknown", "*", ["/node"]),
]
CLOCK = wire.TopicRow("/clock", "rosgraph_msgs/Clock", ["/gazebo"])
TYPES = {row.name: row.type for row in (*ROWS, CLOCK)}
TEXTS = {
    "nav_msgs/Odometry": "Header header\n",
    "sensor_msgs/LaserScan": SCAN,
    "sensor_msgs/CompressedImage": "string format\nuint8[] data\n",
    "rosgraph_msgs/Clock": "time clock\n",
    "std_msgs/String": "string data\n",
    "lab_msgs/Own": "",
}


class Robot:
    """Answers of the robot behind the fake bridge."""

    def __init__(self) -> None:
        self.rows = list(ROWS)
        self.values: Any = {"a": 1, "arm": {"joints": ["x", "y"], "on": True}}
        self.refusal: wire.Refusal | None = None
        self.asked: list[str] = []

    def answer(self, ask: Any) -> Any:
        self.asked.append(wire.kind_of(ask))
        match ask:
            case _ if self.refusal:
                return wire.Refused(wire.kind_of(ask), self.refusal, ask.seq)
            case wire.ListTopics():
                return wire.Graph(self.rows, [], [wire.ServiceRow("/reset", "/base")])
            case wire.ListDefinitions():
                return wire.Definitions(TEXTS)
            case wire.Describe(type=type_name):
                return wire.Described(type_name, "0" * 32, [], "int8 own\n", known=False)
            case wire.GetAllParameters():
                return wire.Parameter("/", self.values)
        raise AssertionError(ask)


class FakeReader:
    """A connection's readings, in place of the tap's. Publishers have the types that the master lists."""

    made: list[FakeReader] = []

    def __init__(self, _feed: Any, deliver: Any, state: Callable[[TapState], None], *_: Any) -> None:
        self.deliver, self.state = deliver, state
        self.readings: dict[str, tuple[float, int]] = {}
        self.refuses: wire.Refusal | None = None
        self.made.append(self)

    def read(self, topic: str, form: str, every_s: float = 0.0, queue: int = 1) -> wire.Refusal | None:
        assert form == "raw"
        self.readings[topic] = every_s, queue
        self.state(TapState(topic, TYPES[topic]))
        return self.refuses

    def end(self, topic: str, _form: str) -> None:
        del self.readings[topic]

    def leave(self) -> None:
        self.readings.clear()


class Client(Page):
    """A Foxglove client."""

    async def open(self) -> Client:
        self._socket.scope["subprotocols"] = ["foxglove.websocket.v1"]
        await super().open()
        return self

    async def ask(self, op: str, **fields: Any) -> None:
        await self.say_raw(json.dumps({"op": op, **fields}))

    async def next(self, op: str, fits: Callable[[Any], bool] = lambda _: True) -> Any:
        """Return the next message of this kind that fits."""
        while True:
            event = await self._event()
            assert event["type"] == "websocket.send", event
            if event.get("text") is not None:
                message = json.loads(event["text"])
                if message["op"] == op and fits(message):
                    return message

    async def frame(self) -> bytes:
        while (frame := (await self._event()).get("bytes")) is None:
            pass
        return bytes(frame)

    async def channels(self) -> dict[str, Any]:
        return {one["topic"]: one for one in (await self.next("advertise"))["channels"]}

    async def subscribe(self, topic: str, number: int = 7) -> FakeReader:
        """Subscribe, and return the readings."""
        channel = (await self.channels())[topic]
        await self.ask("subscribe", subscriptions=[{"id": number, "channelId": channel["id"]}])
        await self.ask("getParameters", id="after")
        await self.next("parameterValues")
        return FakeReader.made[-1]


@pytest.fixture
def behind(bridge, monkeypatch) -> Robot:
    """The robot behind the bridge, which is read often."""
    robot = Robot()
    bridge.answer = robot.answer
    monkeypatch.setattr(FakeReader, "made", [])
    monkeypatch.setattr(consumer, "TapReader", FakeReader)
    monkeypatch.setattr(consumer, "feed_of", lambda link: link)
    monkeypatch.setattr(catalogue, "READ_S", 0.02)
    monkeypatch.setattr(catalogue, "PARAMETERS_S", 0.0)
    return robot


@pytest.fixture
async def connect(robot, behind, observer):
    """`await connect(*scopes)`: a client with a token of the observer."""
    opened = []

    async def one(*scopes, headers=None, protocols=None):
        if headers is None:
            until = timezone.now() + timedelta(days=1)
            _, text = await in_database(
                lambda: token_make(
                    user=observer,
                    name="viewer",
                    scopes=scopes or [Scope.TOPICS],
                    expires_at=until,
                    actor=observer,
                )
            )
            headers = [(b"authorization", f"Bearer {text}".encode())]
        client = Client(headers, f"/foxglove/{robot.slug}")
        opened.append(client)
        return await client.open()

    yield one
    for client in opened:
        await client.close()


# --- opening -------------------------------------------------------------------------------------------


async def test_client_learns_what_the_robot_offers(connect, robot):
    client = await connect()
    info = await client.next("serverInfo")
    assert info["name"] == robot.name
    assert info["capabilities"] == ["parameters", "connectionGraph"]
    assert info["supportedEncodings"] == []
    channels = await client.channels()
    assert set(channels) == {
        "/odom",
        "/scan",
        "/picture",
        "/own",
    }  # a node publishes them, and they have a type
    scan = channels["/scan"]
    assert (scan["encoding"], scan["schemaEncoding"]) == ("ros1", "ros1msg")
    assert (scan["schemaName"], scan["schema"]) == ("sensor_msgs/LaserScan", SCAN)
    assert channels["/own"]["schema"] == "int8 own\n"  # only its publisher knows it


async def test_definitions_are_read_once_for_all(connect, behind):
    await (await connect()).channels()
    await (await connect()).channels()
    assert behind.asked.count("definitions") == behind.asked.count("describe") == 1


async def test_a_publisher_that_does_not_answer_keeps_no_channel_of_others(
    connect, behind, bridge, monkeypatch
):
    answer, waits = bridge._answer, []

    def silent(link: Any, message: Any) -> None:
        is_asked = isinstance(message, wire.LinkQuery) and isinstance(message.ask, wire.Describe)
        waits.append((link, message)) if is_asked else answer(link, message)

    monkeypatch.setattr(bridge, "_answer", silent)
    monkeypatch.setattr(catalogue, "FIRST_S", 0.2)
    client = await connect()
    assert set(await client.channels()) == {"/odom", "/scan", "/picture"}
    assert len(waits) == 1
    answer(*waits[0])
    assert set(await client.channels()) == {"/own"}


async def test_of_types_that_nobody_publishes_any_more_nothing_is_kept(connect, behind):
    client = await connect()
    await client.channels()
    [known] = catalogue._catalogues.values()
    behind.rows = [ODOM]
    await client.next("unadvertise")
    assert set(known._texts) == set(known._asked_s) == {ODOM.type}


async def test_token_without_the_scope_is_refused(connect):
    client = await connect(Scope.DRIVE)
    assert await client.is_closed() == CloseCode.NOT_PERMITTED


@pytest.mark.parametrize(
    ("headers", "code"), [([], "sign_in_first"), ([(b"authorization", b"Bearer nothing")], "token_invalid")]
)
async def test_who_is_not_signed_in_is_told_why(headers, code, connect):
    client = await connect(headers=headers)
    assert (await client.next("status"))["message"].startswith(f"{code}: ")
    assert await client.is_closed() == CloseCode.SIGNED_OUT


async def test_client_without_the_subprotocol_is_told(robot, connect):
    page = Page((await connect())._socket.scope["headers"], f"/foxglove/{robot.slug}")
    await page.open()
    assert await page.is_closed() == CloseCode.NOT_SPOKEN


async def test_person_who_loses_the_role_is_disconnected(connect, observer):
    client = await connect()
    reader = await client.subscribe("/scan")
    await in_database(lambda: RobotRole.objects.filter(user=observer).delete())
    assert await client.is_closed() == CloseCode.NOT_PERMITTED
    assert not reader.readings


async def test_robot_that_is_silent_is_reported(connect, behind):
    behind.refusal = wire.Refusal("robot_offline", "No master answers.", "robot")
    client = await connect()
    assert await client.channels() == {}
    status = await client.next("status")
    assert (status["level"], status["message"]) == (1, "robot_offline: No master answers.")
    behind.refusal = None
    assert "/scan" in await client.channels()


# --- channels ------------------------------------------------------------------------------------------


async def test_channels_follow_the_robot(connect, behind):
    client = await connect()
    before = await client.channels()
    behind.rows = [ODOM, wire.TopicRow("/heard", "std_msgs/String", ["/new"])]
    gone = (await client.next("unadvertise"))["channelIds"]
    assert set(gone) == {before[topic]["id"] for topic in ("/scan", "/picture", "/own")}
    new = await client.channels()
    assert set(new) == {"/heard"}
    assert new["/heard"]["id"] not in {one["id"] for one in before.values()}


async def test_topic_of_another_type_is_another_channel(connect, behind):
    client = await connect()
    before = (await client.channels())["/scan"]
    reader = await client_reads(client, before)
    behind.rows = [wire.TopicRow("/scan", "std_msgs/String", ["/laser"])]
    assert before["id"] in (await client.next("unadvertise"))["channelIds"]
    after = (await client.channels())["/scan"]
    assert (after["schemaName"], after["id"] != before["id"]) == ("std_msgs/String", True)
    assert not reader.readings  # the client subscribes again
    await client.ask("unsubscribe", subscriptionIds=[7])  # it also ends what has ended
    await client_reads(client, after)
    assert set(reader.readings) == {"/scan"}


async def client_reads(client, channel):
    await client.ask("subscribe", subscriptions=[{"id": 7, "channelId": channel["id"]}])
    await client.ask("getParameters")
    await client.next("parameterValues")
    return FakeReader.made[-1]


async def test_definition_of_the_publisher_counts(connect):
    client = await connect()
    reader = await client.subscribe("/scan")
    reader.state(TapState("/scan", "sensor_msgs/LaserScan", "1" * 32, "float64[] ranges\n"))
    await client.next("unadvertise")
    assert (await client.channels())["/scan"]["schema"] == "float64[] ranges\n"


async def test_type_of_the_publisher_counts_also_if_it_is_a_picture(connect, monkeypatch):
    """The master may list another type: that of a node that only subscribes."""
    client = await connect()
    scan = (await client.channels())["/scan"]
    reader = await client_reads(client, scan)
    picture = TapState("/scan", "sensor_msgs/Image", "1" * 32)
    reader.state(picture)  # its definition is not known yet
    await reader.deliver("/scan", "raw", TapMessage("/scan", 1, 1, b"pixels"))
    await client.hears_nothing("", 0.05)
    reader.state(msgspec.structs.replace(picture, definition="uint8[] data\n"))
    await client.next("unadvertise")
    image = (await client.channels())["/scan"]
    monkeypatch.setitem(TYPES, "/scan", image["schemaName"])
    assert image["schemaName"] == "sensor_msgs/Image"
    await client_reads(client, image)
    assert reader.readings == {"/scan": (0.0, 1)}
    await reader.deliver("/scan", "raw", TapMessage("/scan", 2, 1, b"pixels"))
    await client.frame()
    assert await eventually(lambda: Record.objects.filter(kind="camera.start").first())
    await client_catalogue()._read_once()
    assert client_catalogue().channels["/scan"].id == image["id"], (
        "it stays, although the master lists another"
    )


async def test_clock_of_another_type_is_no_time(connect, behind):
    behind.rows = [*ROWS, wire.TopicRow("/clock", "std_msgs/String", ["/node"])]
    client = await connect()
    assert "time" not in (await client.next("serverInfo"))["capabilities"]


# --- messages ------------------------------------------------------------------------------------------


async def test_messages_arrive_as_the_robot_sent_them(connect):
    client = await connect()
    reader = await client.subscribe("/scan", 9)
    assert reader.readings == {"/scan": (0.0, consumer.QUEUE)}
    await reader.deliver("/scan", "raw", TapMessage("/scan", 1, 123_456_789, b"\1\2\3"))
    assert await client.frame() == struct.pack("<BIQ", 1, 9, 123_456_789) + b"\1\2\3"
    await client.ask("unsubscribe", subscriptionIds=[9])
    await client.ask("getParameters")
    await client.next("parameterValues")
    assert not reader.readings
    await reader.deliver("/scan", "raw", TapMessage("/scan", 2, 1, b"late"))
    await client.hears_nothing("", 0.05)


async def test_pictures_wait_for_nobody_and_are_on_record(connect):
    client = await connect()
    reader = await client.subscribe("/picture")
    assert reader.readings == {"/picture": (0.0, 1)}
    await reader.deliver("/picture", "raw", TapMessage("/picture", 1, 1, b"jpeg"))
    await client.frame()
    started = await eventually(lambda: Record.objects.filter(kind="camera.start").first())
    assert started.parameters == {"camera": "/picture"}
    await client.ask("unsubscribe", subscriptionIds=[7])
    assert await eventually(lambda: Record.objects.filter(kind="camera.end", of=started).first())


async def test_what_the_tap_refuses_is_told(connect):
    client = await connect()
    reader = await client.subscribe("/scan")
    reader.state(TapState("/scan", refusal=wire.Refusal("too_large", "Too large.", "robot")))
    assert (await client.next("status"))["message"] == "/scan: too_large: Too large."
    reader.refuses = wire.Refusal("too_many_topics", "Too many.", "limits")
    channel = next(iter(client_catalogue().channels.values()))
    await client.ask("subscribe", subscriptions=[{"id": 8, "channelId": channel.id}])
    assert (await client.next("status"))["message"] == "too_many_topics: Too many."


def client_catalogue():
    [one] = catalogue._catalogues.values()
    return one


async def test_second_subscription_of_a_channel_is_refused(connect):
    client = await connect()
    await client.subscribe("/scan", 1)
    channels = client_catalogue().channels
    for number, topic in ((2, "/scan"), (1, "/odom")):
        await client.ask("subscribe", subscriptions=[{"id": number, "channelId": channels[topic].id}])
        assert (await client.next("status"))["message"].startswith("subscribed_already: ")


async def test_each_subscription_counts_as_a_message(connect, monkeypatch):
    client = await connect()
    await client.subscribe("/scan", 1)
    number = client_catalogue().channels["/scan"].id
    many = [{"id": 1, "channelId": number}] * 1500
    refused, flood = [], asyncio.Event()

    def note(_self, _of, refusal):
        refused.append(refusal.code)
        if refusal.code == "flood":
            flood.set()

    monkeypatch.setattr(consumer.FoxgloveConsumer, "_record_refusal", note)
    await client.ask("subscribe", subscriptions=many)
    await asyncio.wait_for(flood.wait(), 5.0)
    assert len(refused) < 500


@pytest.mark.parametrize("version", [1, 2])
async def test_simulated_time_is_that_of_all_messages(connect, behind, monkeypatch, version: int):
    if version == 2:
        monkeypatch.setitem(TYPES, "/clock", "rosgraph_msgs/msg/Clock")
        monkeypatch.setitem(TEXTS, "rosgraph_msgs/msg/Clock", "time clock\n")
    behind.rows = [*ROWS, structs.replace(CLOCK, type=TYPES["/clock"])]
    client = await connect()
    assert (await client.next("serverInfo"))["capabilities"][-1] == "time"
    reader = await client.subscribe("/scan")
    assert reader.readings["/clock"][0] > 0.0
    head = CDR.head if version == 2 else b""
    await reader.deliver("/clock", "raw", TapMessage("/clock", 1, 99, b"short"))
    await reader.deliver("/clock", "raw", TapMessage("/clock", 1, 99, head + struct.pack("<II", 5, 7)))
    assert await client.frame() == struct.pack("<BQ", 2, 5_000_000_007)
    await reader.deliver("/scan", "raw", TapMessage("/scan", 1, 99, b""))
    assert await client.frame() == struct.pack("<BIQ", 1, 7, 5_000_000_007)


async def test_a_ros_2_robot_has_cdr_and_its_pictures_are_recorded(connect, behind, monkeypatch):
    image = "sensor_msgs/msg/Image"
    monkeypatch.setitem(TYPES, "/picture", image)
    monkeypatch.setitem(TEXTS, image, "uint8[] data\n")
    behind.rows = [wire.TopicRow("/picture", image, ["/camera"])]
    client = await connect()
    reader = await client.subscribe("/picture")
    channel = client_catalogue().channels["/picture"]
    assert (channel.encoding, channel.schemaEncoding) == ("cdr", "ros2msg")
    assert reader.readings["/picture"] == (0.0, 1), "the newest wins"
    await reader.deliver("/picture", "raw", TapMessage("/picture", 1, 99, b""))
    await client.frame()
    assert await eventually(lambda: Record.objects.filter(kind="camera.start").first())


# --- parameters and the graph -----------------------------------------------------------------------------


async def test_parameters_are_read(connect):
    client = await connect()
    await client.ask("getParameters", id="all")
    all_of_them = await client.next("parameterValues")
    assert all_of_them["id"] == "all"
    assert {one["name"]: one["value"] for one in all_of_them["parameters"]} == {
        "/a": 1,
        "/arm/joints": ["x", "y"],
        "/arm/on": True,
    }
    await client.ask("getParameters", parameterNames=["/arm/on", "/none"])
    assert (await client.next("parameterValues"))["parameters"] == [{"name": "/arm/on", "value": True}]


async def test_frequent_parameters_are_slowed_down(connect):
    client = await connect()
    for _ in range(int(consumer.PARAMETERS_BURST) + 2):
        await client.ask("getParameters")
    assert (await client.next("status"))["message"].startswith("busy: ")


async def test_connection_graph_comes_with_its_changes(connect, behind):
    client = await connect()
    await client.ask("subscribeConnectionGraph")
    whole = await client.next("connectionGraphUpdate")
    assert {"name": "/odom", "publisherIds": ["/base"]} in whole["publishedTopics"]
    assert {"name": "/odom", "subscriberIds": ["/gate"]} in whole["subscribedTopics"]
    assert whole["advertisedServices"] == [{"name": "/reset", "providerIds": ["/base"]}]
    behind.rows = [wire.TopicRow("/odom", "nav_msgs/Odometry", [], ["/gate"]), *ROWS[1:3]]
    change = await client.next("connectionGraphUpdate")
    assert change["publishedTopics"] == [{"name": "/odom", "publisherIds": []}]
    assert change["subscribedTopics"] == change["advertisedServices"] == change["removedServices"] == []
    assert change["removedTopics"] == ["/heard", "/own", "/unknown"]
    await client.ask("unsubscribeConnectionGraph")
    behind.rows = []
    await client.next("unadvertise")
    await client.hears_nothing("", 0.05)


# --- refused -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sent", "of"),
    [
        ({"op": "advertise", "channels": [{"id": 1, "topic": "/cmd_vel"}]}, "advertise"),
        (b"\1" + struct.pack("<I", 1) + b"twist", "publish"),
        ({"op": "setParameters", "parameters": [{"name": "/a", "value": 2}], "id": "x"}, "setParameters"),
        (b"\2" + struct.pack("<III", 3, 4, 4) + b"ros1", "call_service"),
    ],
)
async def test_whatever_acts_is_refused_and_on_record(sent, of, connect, observer):
    client = await connect()
    await (client.say_bytes(sent) if isinstance(sent, bytes) else client.say_raw(json.dumps(sent)))
    status = await client.next("status")
    assert status["level"] == 2
    assert status["message"].startswith("read_only: ")
    record = await eventually(lambda: Record.objects.filter(kind="refusal").first())
    assert (str(record.actor_id), record.outcome) == (str(observer.pk), "read_only")
    assert (record.parameters["of"], record.parameters["through"]) == (of, "foxglove")
    if of == "setParameters":  # the client shows the old value again
        values = await client.next("parameterValues")
        assert (values["parameters"], values["id"]) == ([{"name": "/a", "value": 1}], "x")
    if of == "call_service":
        failure = await client.next("serviceCallFailure")
        assert (failure["serviceId"], failure["callId"]) == (3, 4)


async def test_files_are_not_sent(connect):
    client = await connect()
    await client.ask("fetchAsset", uri="package://a/b", requestId=6)
    frame = await client.frame()
    assert frame[:6] == struct.pack("<BIB", 4, 6, 1)
    assert frame[10:].decode() == consumer._NO_FILES.text


@pytest.mark.parametrize(
    ("raw", "code"),
    [
        ("go!", "not_json"),
        ('{"op":"fly"}', "invalid"),
        ('{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}', "invalid"),
        ('{"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":1}]}', "invalid"),
        ('{"op":"getParameters","parameterNames":["' + "x" * 70_000 + '"]}', "too_large"),
        ("[" * 5000, "invalid"),
    ],
)
async def test_malformed_message_keeps_the_connection(raw, code, connect):
    client = await connect()
    await client.say_raw(raw)
    assert (await client.next("status"))["message"].startswith(f"{code}: ")
    await client.ask("getParameters", id="still here")
    assert (await client.next("parameterValues"))["id"] == "still here"


async def test_unknown_channels_are_ignored(connect):
    client = await connect()
    await client.ask("subscribe", subscriptions=[{"id": 1, "channelId": 99999}])
    await client.ask("unsubscribe", subscriptionIds=[5])
    await client.ask("getParameters", id="still here")
    assert (await client.next("parameterValues"))["id"] == "still here"
    assert not FakeReader.made[-1].readings


async def test_catalogue_ends_with_its_last_client(connect):
    client = await connect()
    await client.channels()
    assert client_catalogue()
    await client.close()
    assert not catalogue._catalogues
