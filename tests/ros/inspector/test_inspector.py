"""The inspector with a real rosmaster shows all published messages and answers all queries."""

from __future__ import annotations

import queue
import subprocess
import sys
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
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool, Empty, Float64, Header, String
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from robots.bridge.ros.inspector import graph
from robots.bridge.ros.inspector.side import Ros1
from robots.bridge.topics.inspector.requests import MOST_QUESTIONS, Inspector
from robots.bridge.topics.inspector.subscriptions import rate_hz
from robots.bridge.topics.inspector_messages import (
    Check,
    HaltPublishing,
    InspectorQuery,
)
from robots.bridge.topics.inspector_messages import Report as InspectorReport
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed, BridgeConfig
from robots.shared.ros.message_types.classes import message_class
from tests.inspector_process import InspectorProcess
from tests.processes import PATIENCE_S, REPOSITORY, end, until
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
    Allowed("publish", "/visit_pose", "geometry_msgs/PoseStamped"),
    Allowed("publish", "/weather", UNKNOWN),
    Allowed("call", "/lamp", "std_srvs/SetBool"),
    Allowed("call", "/slow", "std_srvs/Trigger"),
    Allowed("set", "/greeting"),
    Allowed("set", "/farewell"),
    Allowed("publish", "/lab/joy", "std_msgs/String"),  # a forbidden topic stays forbidden on the allow-list
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
def inspector(process, rosmaster) -> Iterator[InspectorProcess]:
    yield process
    process.subscribe()
    until(lambda: not subscribed(rosmaster), "no subscription of the inspector's")


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


# --- the live view ------------------------------------------------------------------------------------


def test_a_message_is_shown_with_its_figures(inspector):
    message = TwistStamped(header=Header(frame_id="base", stamp=rospy.Time.from_sec(time.time())))
    message.twist.linear.x = 0.25
    with talking("/look/twist", message):
        inspector.subscribe(**{"look/twist": 10.0})
        shown = inspector.shown("/look/twist", lambda s: s.rate_hz and s.number > 20)
    assert shown.type == "geometry_msgs/TwistStamped"
    assert shown.fields["twist"]["linear"] == {"x": 0.25, "y": 0.0, "z": 0.0}
    assert shown.fields["header"]["frame_id"] == "base"
    assert 5.0 < shown.rate_hz < 25.0
    assert 0.0 <= shown.age_s < PATIENCE_S
    assert (shown.publishers, shown.refusal) == (1, None)
    assert shown.bytes == 16 + 4 + 48


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


def test_only_the_start_of_a_large_map_or_image_is_shown(inspector):
    grid = OccupancyGrid(data=[7] * 1_000_000)
    grid.info.width = grid.info.height = 1000
    image = Image(height=480, width=640, encoding="rgb8", step=1920, data=bytes(range(256)) * 3600)
    with talking("/look/map", grid, 2.0), talking("/look/image", image, 10.0):
        inspector.subscribe(**{"look/map": 10.0, "look/image": 5.0})
        grid_shown = inspector.shown("/look/map", lambda s: s.number)
        image_shown = inspector.shown("/look/image", lambda s: s.number)
    assert grid_shown.fields["data"] == [7] * 16
    assert grid_shown.shortened == {"data": 1_000_000}
    assert grid_shown.fields["info"]["width"] == 1000
    assert grid_shown.bytes > 1_000_000
    assert image_shown.fields["data"] == list(range(16))
    assert image_shown.shortened == {"data": 921_600}


def test_a_message_of_many_long_texts_is_cut_until_it_fits(inspector):
    state = JointState(name=["j" * 900] * 32, position=[1.0] * 32)
    with talking("/look/texts", state):
        inspector.subscribe(**{"look/texts": 10.0})
        shown = inspector.shown("/look/texts", lambda s: s.number)
    assert len(wire.encode(shown)) <= 16 * 1024
    assert shown.fields["name"] == ["j" * 100 + "…"] * 4
    assert shown.shortened == {"name": 32, "position": 32}


def test_messages_come_at_the_wanted_rate_newest_first(inspector):
    with talking("/look/fast", Empty(), 100.0):
        inspector.subscribe(**{"look/fast": 4.0})
        first = inspector.shown("/look/fast", lambda s: s.rate_hz and s.rate_hz > 50)
        began_s = time.monotonic()
        numbers = [inspector.shown("/look/fast").number for _ in range(4)]
        took_s = time.monotonic() - began_s
    assert took_s > 0.7  # four messages, at four messages a second
    gaps = [after - before for before, after in zip([first.number, *numbers], numbers, strict=False)]
    assert all(gap > 5 for gap in gaps)


def test_a_vanished_topic_is_reported_and_shown_on_return(inspector):
    inspector.subscribe(**{"look/brief": 10.0})
    assert inspector.shown("/look/brief").refusal.code == "no_publisher"
    with talking("/look/brief", String("here")):
        assert inspector.shown("/look/brief", lambda s: s.publishers).refusal is None
    gone = inspector.shown("/look/brief", lambda s: s.publishers == 0)
    assert (gone.refusal.code, gone.fields) == ("no_publisher", {"data": "here"})
    with talking("/look/brief", String("again")):
        assert inspector.shown("/look/brief", lambda s: s.fields.get("data") == "again").refusal is None


def test_a_topic_that_changes_its_type_is_shown_with_the_new_one(inspector):
    with talking("/look/change", String("a")):
        inspector.subscribe(**{"look/change": 10.0})
        assert inspector.shown("/look/change", lambda s: s.number).type == "std_msgs/String"
    with talking("/look/change", Bool(True)):
        shown = inspector.shown("/look/change", lambda s: s.type == "std_msgs/Bool")
    assert shown.fields == {"data": True}


def test_a_topics_only_message_is_shown_to_later_readers(inspector):
    publisher = rospy.Publisher("/look/once", String, queue_size=1, latch=True)
    publisher.publish("for long")
    try:
        inspector.subscribe(**{"look/once": 10.0})
        first, again = (inspector.shown("/look/once", lambda s: s.number) for _ in range(2))
    finally:
        publisher.unregister()
    assert first.fields == again.fields == {"data": "for long"}
    assert (first.number, again.number) == (1, 1)


def test_a_message_grows_older_until_the_next_one_comes(inspector):
    publisher = rospy.Publisher("/look/aging", PoseStamped, queue_size=1, latch=True)
    publisher.publish(PoseStamped(header=Header(stamp=rospy.Time.from_sec(time.time() - 60.0))))
    try:
        inspector.subscribe(**{"look/aging": 10.0})
        first, again = (inspector.shown("/look/aging", lambda s: s.number) for _ in range(2))
    finally:
        publisher.unregister()
    assert 60.0 <= first.age_s < 60.0 + PATIENCE_S
    assert again.age_s - first.age_s == pytest.approx(again.since_s - first.since_s, abs=0.05)
    assert again.since_s > first.since_s


@pytest.mark.parametrize(
    ("arrivals", "now_s", "expected"),
    [
        ([], 5.0, None),
        ([1.0], 5.0, None),
        ([n / 100 for n in range(2000)], 20.0, 100.0),
        ([0.0, 10.0, 20.0, 30.0], 39.0, 0.1),  # one in the window
        ([0.0, 10.0, 20.0, 30.0], 61.0, 0.0),  # three messages are missing
        ([0.0, 0.1, 0.2], 9.0, 10.0),
        ([0.0, 0.1, 0.2], 11.0, 0.0),
        ([0.0, 1000.0, 1000.1, 1000.2], 1000.2, 10.0),  # after a long silence
    ],
)
def test_rates_of_frequent_rare_and_ended_messages_are_right(arrivals, now_s, expected):
    assert rate_hz(arrivals, now_s) == expected


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


def test_a_silent_topic_has_its_publishers_type(inspector):
    publisher = rospy.Publisher("/look/never", Float64, queue_size=1)
    try:
        inspector.subscribe(**{"look/never": 10.0})
        shown = inspector.shown("/look/never", lambda s: s.publishers)
    finally:
        publisher.unregister()
    assert (shown.type, shown.refusal.code) == ("std_msgs/Float64", "no_message")
    assert (shown.number, shown.rate_hz, shown.since_s) == (0, None, None)


def test_disagreeing_publishers_are_reported_and_shown(inspector, rosmaster):
    other = (
        "import robots.bridge.ros, rospy; from std_msgs.msg import Bool;"
        "rospy.init_node('other', disable_signals=True);"
        "rospy.Publisher('/look/discord', Bool, queue_size=1, latch=True).publish(True); rospy.spin()"
    )
    process = subprocess.Popen([sys.executable, "-c", other], cwd=REPOSITORY, env=rosmaster.environment())
    try:
        with talking("/look/discord", String("here")):
            inspector.subscribe(**{"look/discord": 10.0})
            shown = inspector.shown("/look/discord", lambda s: s.refusal and s.fields)
    finally:
        end(process)
    assert shown.refusal.code == "publishers_differ"
    assert f"std_msgs/Bool ({Bool._md5sum}), std_msgs/String ({String._md5sum})" in shown.refusal.text


def test_without_viewers_no_topic_is_subscribed(inspector, rosmaster):
    with talking("/look/seldom", Empty()):
        inspector.subscribe(**{"look/seldom": 10.0})
        inspector.shown("/look/seldom", lambda s: s.number)
        assert list(subscribed(rosmaster)) == ["/look/seldom"]
        inspector.subscribe()
        until(lambda: not subscribed(rosmaster), "no subscription of the inspector's")


# --- questions ------------------------------------------------------------------------------------------


def test_the_graph_has_topics_types_nodes_but_no_inspector(inspector):
    with talking("/ask/pose", PoseStamped()):
        inspector.subscribe(**{"ask/pose": 1.0, "ask/nobody": 1.0})
        inspector.shown("/ask/pose", lambda s: s.number)
        graph = inspector.ask(wire.ListTopics(seq=3))
    rows = {row.name: row for row in graph.topics}
    assert graph.seq == 3
    assert rows["/ask/pose"].type == "geometry_msgs/PoseStamped"
    assert rows["/ask/pose"].publishers == [rospy.get_name()]
    assert rows["/ask/pose"].subscribers == []
    assert "/ask/nobody" not in rows
    assert list(rows) == sorted(rows)
    assert not any("fleet_inspector" in service.name for service in graph.services)


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


def test_an_unknown_type_is_refused_in_words(inspector):
    refused = inspector.ask(wire.Describe("nobody_msgs/Nothing", seq=5))
    assert (refused.refusal.code, refused.of, refused.seq) == ("type_unknown", "describe", 5)


def test_parameters_are_listed_and_read(inspector):
    rospy.set_param("/kitchen", {"oven": {"on": True, "degrees": 180.5, "trays": [1, 2]}, "clock": "noon"})
    names = inspector.ask(wire.ListParameters()).names
    assert "/kitchen/oven/degrees" in names
    assert inspector.ask(wire.GetParameter("/kitchen/oven")).value == {
        "on": True,
        "degrees": 180.5,
        "trays": [1, 2],
    }
    assert inspector.ask(wire.GetParameter("/kitchen/cellar")).refusal.code == "no_parameter"


def test_a_large_parameter_is_refused_a_long_text_cut(inspector):
    rospy.set_param("/large/text", "x" * 100_000)
    rospy.set_param("/larger", list(range(20_000)))
    assert inspector.ask(wire.GetParameter("/large")).value["text"].endswith("x… (100000 characters)")
    assert inspector.ask(wire.GetParameter("/larger")).refusal.code == "too_large"


def test_a_parameter_is_set_only_from_the_allow_list(inspector):
    assert inspector.ask(wire.SetParameter("/greeting", "hello")).value == "hello"
    assert rospy.get_param("/greeting") == "hello"
    assert inspector.ask(wire.SetParameter("/kitchen_light", True)).refusal.code == "not_allowed"
    assert inspector.ask(wire.SetParameter("/robot_description", "")).refusal.code == "not_allowed"
    assert not rospy.has_param("/kitchen_light")
    assert inspector.ask(wire.SetParameter("/greeting", 2**40)).refusal.code == "bad_field"


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
    assert rospy.get_param("/hall") == before
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


def test_a_service_is_called_with_the_allow_lists_type(inspector):
    """Another service with the same name is not called."""
    with serving("/lamp", Trigger, lambda _: TriggerResponse(True, "")):
        refusal = inspector.ask(wire.CallService("/lamp")).refusal
        assert (refusal.code, refusal.figures["type"]) == ("not_allowed", "std_srvs/Trigger")
    with serving("/untyped", Trigger, lambda _: TriggerResponse(True, "")):
        assert inspector.ask(wire.CallService("/untyped")).refusal.code == "not_allowed"


def test_a_service_is_described_and_called_by_allow_list(inspector):
    with serving(
        "/lamp", SetBool, lambda request: SetBoolResponse(request.data, "on" if request.data else "off")
    ):
        (field,) = inspector.ask(wire.DescribeService("/lamp")).fields
        assert (field.name, field.type) == ("data", "bool")
        called = inspector.ask(wire.CallService("/lamp", {"data": True}, seq=9))
        assert (called.fields, called.seq) == ({"success": True, "message": "on"}, 9)
        bad = inspector.ask(wire.CallService("/lamp", {"data": "bright"})).refusal
        assert (bad.code, bad.figures) == ("bad_field", {"path": "data"})
    with serving("/door", SetBool, lambda _: SetBoolResponse()):
        assert inspector.ask(wire.CallService("/door", {"data": True})).refusal.code == "not_allowed"


def test_a_hanging_failing_or_missing_service_is_reported(inspector):
    let_go = threading.Event()
    with serving("/slow", Trigger, lambda _: let_go.wait(PATIENCE_S) and TriggerResponse()):
        assert inspector.ask(wire.CallService("/slow")).refusal.code == "service_silent"
        let_go.set()
    with serving("/slow", Trigger, lambda _: None):
        assert inspector.ask(wire.CallService("/slow")).refusal.code == "service_failed"
    assert inspector.ask(wire.CallService("/slow")).refusal.code == "no_service"


# --- questions of doors ----------------------------------------------------------------------------------


def test_services_have_types_and_types_have_requests_and_responses(inspector):
    with serving("/lamp", SetBool, lambda _: SetBoolResponse()):
        assert inspector.ask(wire.ListServiceTypes(["/lamp", "/nobody"])).types == {
            "/lamp": "std_srvs/SetBool"
        }
        assert inspector.ask(wire.ListServiceTypes()).types["/lamp"] == "std_srvs/SetBool"
        assert inspector.ask(wire.LocateService("/lamp")).host == rosgraph.network.get_host_name().lower()
    assert inspector.ask(wire.LocateService("/nobody")).host == ""
    request = inspector.ask(wire.DescribeServiceType("std_srvs/SetBool"))
    response = inspector.ask(wire.DescribeServiceType("std_srvs/SetBool", response=True))
    assert [field.name for field in request.fields] == ["data"]
    assert [field.name for field in response.fields] == ["success", "message"]
    assert inspector.ask(wire.DescribeServiceType("nobody_srvs/Nothing")).refusal.code == "type_unknown"


def test_definitions_of_all_topics_are_listed(inspector, ros):
    with ros.listen("/notes", String):
        texts = inspector.ask(wire.ListDefinitions()).texts
    assert texts["std_msgs/String"].strip() == "string data"


def test_a_whole_answer_is_not_shortened(inspector):
    rospy.set_param("/large/text", "x" * 100_000)
    assert inspector.ask(wire.GetParameter("/large/text", whole=True)).value == "x" * 100_000
    with serving("/slow", Trigger, lambda _: TriggerResponse(True, "y" * 3000)):
        assert len(inspector.ask(wire.CallService("/slow")).fields["message"]) < 3000
        assert inspector.ask(wire.CallService("/slow", whole=True)).fields["message"] == "y" * 3000


def test_all_parameters_are_read_at_once(inspector):
    rospy.set_param("/large/text", "x" * 100_000)
    tree = inspector.ask(wire.GetAllParameters())
    assert tree.name == "/"
    assert tree.value["large"]["text"] == "x" * 100_000


def test_a_parameter_is_deleted_only_from_the_allow_list(inspector):
    rospy.set_param("/farewell", "bye")
    rospy.set_param("/kitchen_lamp", True)
    assert inspector.ask(wire.DeleteParameter("/farewell")).value is None
    assert not rospy.has_param("/farewell")
    assert inspector.ask(wire.DeleteParameter("/farewell")).refusal.code == "no_parameter"
    assert inspector.ask(wire.DeleteParameter("/kitchen_lamp")).refusal.code == "not_allowed"
    rospy.set_param("/hall", {"light": 1, "robot_description": "<robot/>"})
    assert inspector.ask(wire.DeleteParameter("/hall")).refusal.code == "not_allowed"
    rospy.delete_param("/hall")


def test_the_robots_time_is_told(inspector):
    told = inspector.ask(wire.GetTime())
    assert abs(told.secs + told.nsecs / 1e9 - time.time()) < 5.0


# --- publishing -----------------------------------------------------------------------------------------


def order(topic: str, type_name: str, fields: dict[str, Any], rate_hz: float = 0.0) -> wire.Publish:
    return wire.Publish(1, topic, type_name, fields, rate_hz)


def test_a_single_message_reaches_listeners_then_silence(inspector, ros):
    with ros.listen("/notes", String) as notes:
        note = order("/notes", "std_msgs/String", {"data": "Grüß Gott"})
        assert inspector.done(lambda number: Check(number, note)) is None
        inspector.send(note)
        assert notes.next().data == "Grüß Gott"
        inspector.send(note)
        notes.next()
        assert notes.drain() == []


def test_a_nested_message_is_published_at_a_rate_until_stop(inspector, ros):
    fields = {"pose.position": {"x": 1.5}, "pose.orientation.w": 1, "header": {"frame_id": "map"}}
    goal = order("/visit_pose", "geometry_msgs/PoseStamped", fields, 20.0)
    with ros.listen("/visit_pose", PoseStamped) as goals:
        assert inspector.done(lambda number: Check(number, goal)) is None
        inspector.send(goal)
        first, second = goals.next(), goals.next()
        assert inspector.done(lambda number: HaltPublishing(number, "/visit_pose")) is None
        goals.drain()
        with pytest.raises(AssertionError):
            goals.next(0.3)
    assert (first.pose.position.x, first.pose.orientation.w, first.header.frame_id) == (1.5, 1.0, "map")
    # Each message has its own stamp
    assert 0 < second.header.stamp.to_sec() - first.header.stamp.to_sec() < PATIENCE_S


def test_fields_that_do_not_fit_are_refused_with_their_path(inspector):
    wrong = order("/visit_pose", "geometry_msgs/PoseStamped", {"pose.position.x": "far"})
    refusal = inspector.done(lambda number: Check(number, wrong))
    assert (refusal.code, refusal.figures) == ("bad_field", {"path": "pose.position.x"})


def test_a_type_known_only_to_a_publisher_is_published(inspector, ros):
    weather = generated(UNKNOWN, UNKNOWN_TEXT)
    report = order("/weather", UNKNOWN, {"sky": "RAIN", "stations": [{"name": "a"}, {"place": {"z": 3}}]})
    with ros.listen("/weather", weather) as heard, talking("/weather", weather(), 1.0):
        assert inspector.done(lambda number: Check(number, report)) is None
        inspector.send(report)
        message = heard.until(lambda m: m.sky == 1)
    assert [station.place.z for station in message.stations] == [0.0, 3.0]


@pytest.mark.parametrize("topic", ["/diary", "/lab/joy"])
def test_unlisted_or_forbidden_topics_are_not_even_checked(inspector, topic):
    other = order(topic, "std_msgs/String", {})
    assert inspector.done(lambda number: Check(number, other)).code == "not_allowed"


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


def test_with_stdin_everything_ends(rosmaster, ros, tmp_path):
    inspector = InspectorProcess(tiago_config(rosmaster, tmp_path, allowed=ALLOWED), rosmaster.environment())
    note = order("/notes", "std_msgs/String", {"data": "on and on"}, 50.0)
    with ros.listen("/notes", String) as notes, talking("/look/end", Empty()):
        inspector.done(lambda number: Check(number, note))
        inspector.send(note)
        inspector.subscribe(**{"look/end": 5.0})
        notes.next()
        inspector.shown("/look/end", lambda s: s.number)
        assert inspector.stop() == 0
    assert not subscribed(rosmaster)


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
