"""The inspector with a real rosmaster: types that are not installed, rosparam, and the end of the master."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import genpy.dynamic
import msgspec
import pytest
import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger, TriggerResponse

from robots.bridge.ros.inspector import graph
from robots.bridge.ros.inspector.side import Ros1
from robots.bridge.topics.inspector.requests import MOST_QUESTIONS, Inspector
from robots.bridge.topics.inspector_messages import (
    Check,
    InspectorQuery,
)
from robots.bridge.topics.inspector_messages import Report as InspectorReport
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed, BridgeConfig
from robots.shared.ros.message_types.classes import message_class
from tests.inspector_process import InspectorProcess
from tests.processes import PATIENCE_S, until
from tests.ros.bridge_support import tiago_config
from tests.ros.spoiled_master import CUT_SHORT, spoiling
from tests.ros.support import Master


def started(config: BridgeConfig, say: Callable[[bytes], None]) -> Inspector:
    """Return the inspector of a robot, within this process."""
    return Inspector(config, Ros1(config), say)


UNKNOWN = "fleet_test_msgs/Weather"
UNKNOWN_TEXT = """\
uint8 SUN=0
uint8 RAIN=1
uint8 sky
float32[] hourly
Station[2] stations
================================================================================
MSG: fleet_test_msgs/Station
string name
geometry_msgs/Point place
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
"""
ALLOWED = (
    Allowed("publish", "/notes", "std_msgs/String"),
    Allowed("publish", "/weather", UNKNOWN),
    Allowed("call", "/lamp", "std_srvs/SetBool"),
    Allowed("call", "/slow", "std_srvs/Trigger"),
    Allowed("set", "/greeting"),
    Allowed("set", "/robot_description"),
    Allowed("set", "/hall"),
    Allowed("publish", "/order", "lab_msgs/Order"),
    Allowed("call", "/untyped"),
)

_report = msgspec.json.Decoder(InspectorReport)


@pytest.fixture(scope="module")
def process(rosmaster, ros, tmp_path_factory) -> Iterator[InspectorProcess]:
    config = tiago_config(rosmaster, tmp_path_factory.mktemp("inspector"), allowed=ALLOWED)
    process = InspectorProcess(config, rosmaster.environment())
    yield process
    assert process.stop() == 0


@pytest.fixture
def inspector(process) -> Iterator[InspectorProcess]:
    yield process
    process.subscribe()


@contextmanager
def talking(topic: str, message: Any, rate_hz: float = 20.0) -> Iterator[rospy.Publisher]:
    """Publish a message repeatedly for the length of a `with` block."""
    publisher = rospy.Publisher(topic, type(message), queue_size=1)
    over = threading.Event()

    def talk() -> None:
        while not over.wait(1.0 / rate_hz):
            publisher.publish(message)

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    try:
        yield publisher
    finally:
        over.set()
        thread.join()
        publisher.unregister()


@contextmanager
def serving(name: str, kind: Any, answer: Callable[[Any], Any]) -> Iterator[None]:
    """Offer a service for the length of a `with` block."""
    service = rospy.Service(name, kind, answer)
    try:
        yield
    finally:
        service.shutdown()


def generated(name: str, text: str) -> Any:
    """A message class of a package that is not installed here."""
    return genpy.dynamic.generate_dynamic(name, text)[name]


def tts(part: str) -> Any:
    return message_class(f"pal_interaction_msgs/Tts{part}")


def subscribed(master: Master) -> dict[str, list[str]]:
    """Return the nodes of inspectors that subscribe to each topic."""
    _, subscribers, _ = rosgraph.Master("/test", master.uri).getSystemState()
    return {topic: nodes for topic, nodes in subscribers if any("fleet_inspector" in node for node in nodes)}


def test_a_missing_type_is_shown_by_its_publishers_definition(inspector):
    weather = generated(UNKNOWN, UNKNOWN_TEXT)
    message = weather(sky=1, hourly=[0.1, float("nan"), float("-inf")])
    message.stations[1].name = "Gràcia"
    message.stations[1].place.y = 2.5
    with talking("/look/weather", message):
        inspector.subscribe(**{"look/weather": 10.0})
        shown = inspector.shown("/look/weather", lambda s: s.fields)
        described = inspector.ask(wire.Describe(UNKNOWN, "/look/weather", seq=7))
    assert shown.type == UNKNOWN
    assert shown.fields["sky"] == 1
    assert shown.fields["hourly"] == [0.1, "NaN", "-Infinity"]
    assert shown.fields["stations"][1] == {"name": "Gràcia", "place": {"x": 0.0, "y": 2.5, "z": 0.0}}
    assert (described.known, described.md5, described.seq) == (False, weather._md5sum, 7)
    sky, _, stations = described.fields
    assert sky.constants == {"SUN": 0, "RAIN": 1}
    assert (stations.array, [field.name for field in stations.fields]) == (2, ["name", "place"])
    # The inspector keeps a type: also without a topic, and for publishers that send no definition.
    assert inspector.ask(wire.Describe(UNKNOWN)).md5 == weather._md5sum


def test_a_definition_with_a_wrong_md5_sum_is_refused(inspector):
    honest = generated("fleet_test_msgs/Level", "float64 level\n")
    liar = type("Liar", (honest,), {"_full_text": "int64 level\n"})
    with talking("/look/liar", liar(1.0)):
        inspector.subscribe(**{"look/liar": 10.0})
        shown = inspector.shown("/look/liar", lambda s: s.number)
    assert shown.refusal.code == "definition_differs"
    assert shown.fields == {}
    assert shown.refusal.figures["claimed_md5"] == honest._md5sum
    with talking("/look/mute", type("Mute", (honest,), {"_full_text": ""})(2.0)):
        inspector.subscribe(**{"look/mute": 10.0})
        assert inspector.shown("/look/mute", lambda s: s.number).refusal.code == "type_unknown"
        with talking("/look/honest", honest(3.0)):  # the definition of this publisher is used for both topics
            inspector.subscribe(**{"look/honest": 10.0, "look/mute": 10.0})
            assert inspector.shown("/look/honest", lambda s: s.number).fields == {"level": 3.0}
            assert inspector.shown("/look/mute", lambda s: s.fields).fields == {"level": 2.0}


def test_a_publisher_in_java_is_read_by_installed_types(inspector):
    """rosjava and rosnodejs send a type's text without the types inside it."""
    pose = PoseStamped._full_text
    whole = (
        f"Header header\ngeometry_msgs/PoseStamped place\n{'=' * 80}\nMSG: geometry_msgs/PoseStamped\n{pose}"
    )
    place = generated("fleet_test_msgs/Place", whole)
    short = type("Place", (place,), {"_full_text": "Header header\r\ngeometry_msgs/PoseStamped place\r\n"})
    message = short()
    message.place.pose.position.x = 1.5
    with talking("/look/place", message):
        inspector.subscribe(**{"look/place": 10.0})
        shown = inspector.shown("/look/place", lambda s: s.number)
    assert shown.refusal is None
    assert shown.fields["place"]["pose"]["position"]["x"] == 1.5


def test_bytes_that_do_not_fit_the_definition_are_reported(inspector):
    class Cut(Float64):  # its type is Float64, but it sends only half of the bytes
        __slots__ = ()

        def serialize(self, buff: Any) -> None:
            buff.write(b"1234")

    with talking("/look/cut", Cut()):
        inspector.subscribe(**{"look/cut": 10.0})
        shown = inspector.shown("/look/cut", lambda s: s.number)
    assert (shown.refusal.code, shown.fields) == ("broken", {})


def test_every_message_is_counted_also_of_many_that_come_at_once(inspector):
    publisher = rospy.Publisher("/look/burst", Float64, queue_size=1000)
    try:
        inspector.subscribe(**{"look/burst": 10.0})
        until(publisher.get_num_connections, "the inspector")
        for number in range(500):
            publisher.publish(number)
        last = inspector.shown("/look/burst", lambda s: s.fields.get("data") == 499)
    finally:
        publisher.unregister()
    assert last.number == 500


def test_an_action_is_recognised_by_its_type(inspector):
    goal = rospy.Subscriber("/ask/say/goal", tts("ActionGoal"))
    cancel = rospy.Subscriber("/ask/say/cancel", String)
    answers = [
        rospy.Publisher(f"/ask/say/{part}", kind, queue_size=1)
        for part, kind in (
            ("status", String),
            ("feedback", tts("ActionFeedback")),
            ("result", tts("ActionResult")),
        )
    ]
    try:
        graph = inspector.ask(wire.ListTopics())
    finally:
        for topic in (goal, cancel, *answers):
            topic.unregister()
    assert wire.ActionRow("/ask/say", "pal_interaction_msgs/TtsAction") in graph.actions


def test_five_hundred_topics_are_listed_at_once(inspector, rosmaster):
    master = rosgraph.Master("/crowd", rosmaster.uri)
    names = [f"/crowd/topic_{number}" for number in range(500)]
    for name in names:
        master.registerPublisher(name, "std_msgs/String", "http://127.0.0.1:9/")
    try:
        began_s = time.monotonic()
        graph = inspector.ask(wire.ListTopics())
        took_s = time.monotonic() - began_s
    finally:
        for name in names:
            master.unregisterPublisher(name, "http://127.0.0.1:9/")
    assert {row.name for row in graph.topics} >= set(names)
    assert took_s < 2.0


def test_a_large_parameter_is_refused(inspector):
    rospy.set_param("/larger", list(range(20_000)))
    assert inspector.ask(wire.GetParameter("/larger")).refusal.code == "too_large"


@pytest.mark.parametrize(
    ("before", "value"),
    [
        ({"light": 1}, {"light": 2, "scan": {"enabled": False}}),
        ({"light": 1}, {"robot": {"use_sim_time": True}}),
        ({"light": 1, "robot_description": "<robot/>"}, 5),  # this value would delete robot_description
    ],
)
def test_no_parameter_branch_with_forbidden_names_is_set(inspector, before, value):
    rospy.set_param("/hall", before)
    assert inspector.ask(wire.SetParameter("/hall", value)).refusal.code == "not_allowed"
    assert inspector.ask(wire.SetParameter("/robot_description", "")).refusal.code == "not_allowed"
    assert rospy.get_param("/hall") == before
    rospy.set_param("/hall", {"light": 1, "robot_description": "<robot/>"})
    assert inspector.ask(wire.DeleteParameter("/hall")).refusal.code == "not_allowed"
    rospy.delete_param("/hall")
    assert inspector.ask(wire.SetParameter("/hall", {"light": 3})).value == {"light": 3}


def test_no_parameter_is_set_while_its_old_value_is_unknown(inspector, rosmaster, tmp_path):
    inspector.ask(wire.SetParameter("/greeting", "before"))
    answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    with spoiling(rosmaster) as master:
        master.spoiled["getParam"] = CUT_SHORT
        lame = started(tiago_config(master, tmp_path, allowed=ALLOWED), answers.put)
        lame.handle_line(msgspec.json.encode(InspectorQuery(1, wire.SetParameter("/greeting", "after"))))
        assert b"robot_offline" in answers.get(timeout=PATIENCE_S)
    assert rospy.get_param("/greeting") == "before"
    assert inspector.ask(wire.SetParameter("/greeting", 2**40)).refusal.code == "bad_field"


def test_a_hanging_or_failing_service_is_reported(inspector):
    let_go = threading.Event()
    with serving("/slow", Trigger, lambda _: let_go.wait(PATIENCE_S) and TriggerResponse()):
        assert inspector.ask(wire.CallService("/slow")).refusal.code == "service_silent"
        let_go.set()
    with serving("/slow", Trigger, lambda _: None):
        assert inspector.ask(wire.CallService("/slow")).refusal.code == "service_failed"


# --- publishing -----------------------------------------------------------------------------------------


def order(topic: str, type_name: str, fields: dict[str, Any], rate_hz: float = 0.0) -> wire.Publish:
    return wire.Publish(1, topic, type_name, fields, rate_hz)


def test_a_type_known_only_to_a_publisher_is_published(inspector, ros):
    weather = generated(UNKNOWN, UNKNOWN_TEXT)
    report = order("/weather", UNKNOWN, {"sky": "RAIN", "stations": [{"name": "a"}, {"place": {"z": 3}}]})
    with ros.listen("/weather", weather) as heard, talking("/weather", weather(), 1.0):
        assert inspector.done(lambda number: Check(number, report)) is None
        inspector.send(report)
        message = heard.until(lambda m: m.sky == 1)
    assert [station.place.z for station in message.stations] == [0.0, 3.0]


TWIST_TEXT = "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"
VECTOR_TEXT = f"{'=' * 80}\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"


@pytest.mark.parametrize(
    "text",
    [
        TWIST_TEXT + VECTOR_TEXT,  # the same bytes, and so the same md5 sum, as geometry_msgs/Twist
        f"string why\ngeometry_msgs/Twist[] how\n{'=' * 80}\nMSG: geometry_msgs/Twist\n{TWIST_TEXT}{VECTOR_TEXT}",
        f"string why\nHow[] how\n{'=' * 80}\nMSG: lab_msgs/How\n{TWIST_TEXT}{VECTOR_TEXT}",
    ],
    ids=["renamed", "wrapped", "renamed and wrapped"],
)
def test_a_velocity_is_one_whatever_its_type_is_called(inspector, text):
    kind = generated("lab_msgs/Order", text)
    with talking("/order", kind(), 1.0):
        refusal = inspector.done(lambda number: Check(number, order("/order", "lab_msgs/Order", {})))
    assert refusal.code == "not_allowed"
    assert "velocities" in refusal.text


def test_a_velocity_within_a_text_that_omits_it_is_one(inspector):
    whole = f"geometry_msgs/Twist how\n{'=' * 80}\nMSG: geometry_msgs/Twist\n{TWIST_TEXT}{VECTOR_TEXT}"
    short = type("Order", (generated("lab_msgs/Order", whole),), {"_full_text": "geometry_msgs/Twist how\n"})
    with talking("/order", short(), 1.0):
        refusal = inspector.done(lambda number: Check(number, order("/order", "lab_msgs/Order", {})))
    assert refusal.code == "not_allowed"


def test_with_its_master_it_ends(make_master, tmp_path):
    master = make_master()
    inspector = InspectorProcess(tiago_config(master, tmp_path), master.environment())
    inspector.subscribe(rosout=5.0)
    until(lambda: subscribed(master), "a look")
    master.stop()
    assert inspector.process.wait(PATIENCE_S) == 1
    inspector.stop()


def test_only_so_many_questions_are_under_way_at_once(monkeypatch, tmp_path, rosmaster):
    """The inspector drops queries above the limit. The bridge gets no answer and refuses them."""
    answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    begun = threading.Semaphore(0)
    go_on = threading.Event()

    def waits(_master: Any, seq: int) -> wire.Graph:
        begun.release()
        go_on.wait(PATIENCE_S)
        return wire.Graph([], [], [], seq)

    monkeypatch.setattr(graph, "graph", waits)
    asked = started(tiago_config(rosmaster, tmp_path), answers.put)
    for number in range(MOST_QUESTIONS + 1):
        asked.handle_line(wire.encode(wire.LinkQuery(number, wire.ListTopics())))
    for _ in range(MOST_QUESTIONS):
        assert begun.acquire(timeout=PATIENCE_S)
    assert not begun.acquire(timeout=0.1)
    go_on.set()
    answered = {_report.decode(answers.get(timeout=PATIENCE_S)).seq for _ in range(MOST_QUESTIONS)}
    assert answered == set(range(MOST_QUESTIONS))
    assert answers.empty()


def test_without_a_master_it_says_so_and_ends(tmp_path, rosmaster):
    dead = Master(tmp_path)
    inspector = InspectorProcess(tiago_config(dead, tmp_path), dead.environment())
    assert inspector.ask(wire.ListTopics()).refusal.code == "robot_offline"
    inspector.subscribe(anything=5.0)
    assert inspector.shown("/anything").refusal.code == "robot_offline"
    assert inspector.process.wait(PATIENCE_S) == 1
    inspector.stop()
