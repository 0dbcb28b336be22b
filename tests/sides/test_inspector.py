"""The inspector of a robot: it shows all published messages, answers all queries, and publishes by an allow-list."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from typing import Any

import pytest

from robots.bridge.topics.inspector_messages import Check, HaltPublishing
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.graph import INSPECTOR
from tests.inspector_process import InspectorProcess
from tests.processes import PATIENCE_S, until
from tests.sides.side import Side
from tests.sides.visitor import Requests, Speaker, Visitor

STRING, POSE, TWIST = "std_msgs/String", "geometry_msgs/PoseStamped", "geometry_msgs/TwistStamped"
SWITCH, TRIGGER = "std_srvs/SetBool", "std_srvs/Trigger"
NODE = "/visitor"  # has the parameters

Serving = Callable[..., AbstractContextManager[Requests]]


@pytest.fixture(scope="module")
def process(
    side: Side, visitor: Visitor, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[InspectorProcess]:
    allowed = (
        Allowed("publish", "/notes", side.type(STRING)),
        Allowed("publish", "/visit_pose", side.type(POSE)),
        Allowed(
            "publish", "/lab/joy", side.type(STRING)
        ),  # a forbidden topic stays forbidden on the allow-list
        Allowed("call", "/lamp", side.service_type(SWITCH)),
        Allowed("call", "/slow", side.service_type(TRIGGER)),
        Allowed("set", side.parameter(NODE, "greeting")),
        Allowed("set", side.parameter(NODE, "farewell")),
    )
    config = side.config(tmp_path_factory.mktemp("inspector"), allowed=allowed)
    with visitor.listen(config.topics.drive.name, "geometry_msgs/Twist"):  # as a robot
        process = InspectorProcess(config, side.environment())
        yield process
        assert process.stop() == 0


@pytest.fixture
def inspector(process: InspectorProcess) -> Iterator[InspectorProcess]:
    yield process
    process.subscribe()


@pytest.fixture(scope="module")
def other(side: Side, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Visitor]:
    with closing(Visitor(side, tmp_path_factory.mktemp("other"), "other")) as other:
        yield other


@contextmanager
def talking(visitor: Visitor, topic: str, kind: str, hz: float = 20.0, **fields: Any) -> Iterator[None]:
    """Publish a message repeatedly for the length of a `with` block."""
    with visitor.speak(topic, kind, listeners=0) as speaker:
        speaker.repeat(hz, **fields)
        yield


@contextmanager
def kept(visitor: Visitor, topic: str, kind: str, **fields: Any) -> Iterator[Speaker]:
    """Publish a message that later readers get too."""
    with visitor.speak(topic, kind, listeners=0, kept=True) as speaker:
        speaker.publish(**fields)
        yield speaker


@pytest.fixture
def serving(side: Side, visitor: Visitor, inspector: InspectorProcess) -> Serving:
    """``with serving(name, kind, **answer)``: a service that the inspector has found; yields its requests."""

    @contextmanager
    def serve(name: str, kind: str, **answer: Any) -> Iterator[Requests]:
        def types() -> dict[str, str]:
            found: dict[str, str] = inspector.ask(wire.ListServiceTypes([name])).types
            return found

        with visitor.serve(name, kind, **answer) as requests:
            until(lambda: types() == {name: side.service_type(kind)}, f"the service {name}")
            yield requests
        until(lambda: not types(), f"the end of {name}")

    return serve


# --- the live view ------------------------------------------------------------------------------------


def test_a_message_is_shown_with_its_figures(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    header = {"frame_id": "base", "stamp": time.time()}
    with talking(visitor, "/look/twist", TWIST, header=header, twist={"linear": {"x": 0.25}}):
        inspector.subscribe(**{"look/twist": 10.0})
        shown = inspector.shown("/look/twist", lambda s: s.rate_hz and s.number > 20)
    assert shown.type == side.type(TWIST)
    assert shown.fields["twist"]["linear"] == {"x": 0.25, "y": 0.0, "z": 0.0}
    assert shown.fields["header"]["frame_id"] == "base"
    assert 5.0 < shown.rate_hz < 25.0
    assert 0.0 <= shown.age_s < PATIENCE_S
    assert (shown.publishers, shown.publisher_names, shown.refusal) == (1, [visitor.name], None)
    assert 16 + 4 + 48 <= shown.bytes < 100


def test_only_the_start_of_a_large_map_or_image_is_shown(
    inspector: InspectorProcess, visitor: Visitor
) -> None:
    grid = {"info": {"width": 1000, "height": 100}, "data": [7] * 100_000}
    image = {"height": 4, "width": 640, "encoding": "rgb8", "step": 1920, "data": list(range(256)) * 30}
    with (
        kept(visitor, "/look/map", "nav_msgs/OccupancyGrid", **grid),
        kept(visitor, "/look/image", "sensor_msgs/Image", **image),
    ):
        inspector.subscribe(**{"look/map": 10.0, "look/image": 5.0})
        grid_shown = inspector.shown("/look/map", lambda s: s.number)
        image_shown = inspector.shown("/look/image", lambda s: s.number)
    assert grid_shown.fields["data"] == [7] * 16
    assert grid_shown.shortened == {"data": 100_000}
    assert grid_shown.fields["info"]["width"] == 1000
    assert grid_shown.bytes > 100_000
    assert image_shown.fields["data"] == list(range(16))
    assert image_shown.shortened == {"data": 7680}


def test_a_message_of_many_long_texts_is_cut_until_it_fits(
    inspector: InspectorProcess, visitor: Visitor
) -> None:
    with kept(visitor, "/look/texts", "sensor_msgs/JointState", name=["j" * 900] * 32, position=[1.0] * 32):
        inspector.subscribe(**{"look/texts": 10.0})
        shown = inspector.shown("/look/texts", lambda s: s.number)
    assert len(wire.encode(shown)) <= 16 * 1024
    assert shown.fields["name"] == ["j" * 100 + "…"] * 4
    assert shown.shortened == {"name": 32, "position": 32}


def test_messages_come_at_the_wanted_rate_newest_first(inspector: InspectorProcess, visitor: Visitor) -> None:
    with talking(visitor, "/look/fast", "std_msgs/Empty", 100.0):
        inspector.subscribe(**{"look/fast": 4.0})
        first = inspector.shown("/look/fast", lambda s: s.rate_hz and s.rate_hz > 40)
        began_s = time.monotonic()
        numbers = [inspector.shown("/look/fast").number for _ in range(4)]
        took_s = time.monotonic() - began_s
    assert took_s > 0.7  # four messages, at four messages a second
    gaps = [after - before for before, after in zip([first.number, *numbers], numbers, strict=False)]
    assert all(gap > 5 for gap in gaps)


def test_a_vanished_topic_is_reported_and_shown_on_return(
    inspector: InspectorProcess, visitor: Visitor
) -> None:
    inspector.subscribe(**{"look/brief": 10.0})
    assert inspector.shown("/look/brief").refusal.code == "no_publisher"
    with talking(visitor, "/look/brief", STRING, data="here"):
        assert inspector.shown("/look/brief", lambda s: s.fields).refusal is None
    gone = inspector.shown("/look/brief", lambda s: s.publishers == 0)
    assert (gone.refusal.code, gone.fields) == ("no_publisher", {"data": "here"})
    with talking(visitor, "/look/brief", STRING, data="again"):
        again = inspector.shown("/look/brief", lambda s: s.fields.get("data") == "again" and s.publishers)
        assert again.refusal is None


def test_a_topic_that_changes_its_type_is_shown_with_the_new_one(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    with talking(visitor, "/look/change", STRING, data="a"):
        inspector.subscribe(**{"look/change": 10.0})
        assert inspector.shown("/look/change", lambda s: s.number).type == side.type(STRING)
    with talking(visitor, "/look/change", "std_msgs/Bool", data=True):
        shown = inspector.shown("/look/change", lambda s: s.fields == {"data": True})
    assert shown.type == side.type("std_msgs/Bool")


def test_a_topics_only_message_is_shown_to_later_readers_as_it_ages(
    inspector: InspectorProcess, visitor: Visitor
) -> None:
    with kept(visitor, "/look/aging", POSE, header={"frame_id": "map", "stamp": time.time() - 60.0}):
        inspector.subscribe(**{"look/aging": 10.0})
        first, again = (inspector.shown("/look/aging", lambda s: s.number) for _ in range(2))
    assert first.fields == again.fields and first.fields["header"]["frame_id"] == "map"
    assert (first.number, again.number) == (1, 1)
    assert 60.0 <= first.age_s < 60.0 + PATIENCE_S
    assert again.age_s - first.age_s == pytest.approx(again.since_s - first.since_s, abs=0.05)
    assert again.since_s > first.since_s


def test_a_silent_topic_has_its_publishers_type(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    with visitor.speak("/look/never", "std_msgs/Float64", listeners=0):
        inspector.subscribe(**{"look/never": 10.0})
        shown = inspector.shown("/look/never", lambda s: s.publishers)
    assert (shown.type, shown.refusal.code) == (side.type("std_msgs/Float64"), "no_message")
    assert (shown.number, shown.rate_hz, shown.since_s) == (0, None, None)


def test_disagreeing_publishers_are_reported_and_shown(
    side: Side, inspector: InspectorProcess, visitor: Visitor, other: Visitor
) -> None:
    with (
        talking(other, "/look/discord", "std_msgs/Bool", data=True),
        talking(visitor, "/look/discord", STRING, data="here"),
    ):
        inspector.subscribe(**{"look/discord": 10.0})
        shown = inspector.shown("/look/discord", lambda s: s.refusal and s.fields)
    assert shown.refusal.code == "publishers_differ"
    for kind in ("std_msgs/Bool", STRING):
        assert f"{side.type(kind)} (" in shown.refusal.text


def test_without_viewers_no_topic_is_subscribed(inspector: InspectorProcess, visitor: Visitor) -> None:
    def listeners() -> list[str]:
        return [node for node in visitor.listeners("/look/seldom") if INSPECTOR in node]

    with talking(visitor, "/look/seldom", "std_msgs/Empty"):
        inspector.subscribe(**{"look/seldom": 10.0})
        inspector.shown("/look/seldom", lambda s: s.number)
        assert listeners()
        inspector.subscribe()
        until(lambda: not listeners(), "no subscription of the inspector's")


# --- questions ------------------------------------------------------------------------------------------


def test_the_graph_has_topics_types_nodes_but_no_inspector(
    side: Side, inspector: InspectorProcess, visitor: Visitor, serving: Serving
) -> None:
    with talking(visitor, "/ask/pose", POSE), serving("/lamp", SWITCH):
        inspector.subscribe(**{"ask/pose": 1.0, "ask/nobody": 1.0})
        inspector.shown("/ask/pose", lambda s: s.number)
        graph = inspector.ask(wire.ListTopics(seq=3))
    rows = {row.name: row for row in graph.topics}
    assert graph.seq == 3
    assert rows["/ask/pose"].type == side.type(POSE)
    assert rows["/ask/pose"].publishers == [visitor.name]
    assert rows["/ask/pose"].subscribers == []
    assert "/ask/nobody" not in rows
    assert list(rows) == sorted(rows)
    services = {row.name: row.node for row in graph.services}
    assert services["/lamp"] == visitor.name
    assert not [name for name in services if INSPECTOR in name or "parameter" in name]


def test_types_are_described_also_without_a_topic(side: Side, inspector: InspectorProcess) -> None:
    described = inspector.ask(wire.Describe(side.type(POSE)))
    assert [field.name for field in described.fields] == ["header", "pose"]
    assert described.md5 and "MSG: geometry_msgs/Pose" in described.text
    refused = inspector.ask(wire.Describe("nobody_msgs/Nothing", seq=5))
    assert (refused.refusal.code, refused.of, refused.seq) == ("type_unknown", "describe", 5)


def test_definitions_of_all_topics_are_listed(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    def told() -> bool:
        return "string data" in inspector.ask(wire.ListDefinitions()).texts.get(side.type(STRING), "")

    with visitor.listen("/notes", STRING):
        until(told, "the definition")


def test_the_robots_time_is_told(inspector: InspectorProcess) -> None:
    told = inspector.ask(wire.GetTime())
    assert abs(told.secs + told.nsecs / 1e9 - time.time()) < 5.0


# --- parameters -----------------------------------------------------------------------------------------


def test_parameters_are_listed_and_read(side: Side, inspector: InspectorProcess, visitor: Visitor) -> None:
    for name, value in {"on": True, "degrees": 180.5, "trays": [1, 2]}.items():
        visitor.set_parameter(NODE, f"oven.{name}", value)
    assert side.parameter(NODE, "oven.degrees") in inspector.ask(wire.ListParameters()).names
    tree = inspector.ask(wire.GetParameter(side.parameter(NODE, "oven"))).value
    assert tree == {"on": True, "degrees": 180.5, "trays": [1, 2]}
    assert inspector.ask(wire.GetParameter(side.parameter(NODE, "cellar"))).refusal.code == "no_parameter"
    assert inspector.ask(wire.GetParameter("/nobody")).refusal.code == "no_parameter"


def test_a_long_text_is_cut_unless_the_whole_is_asked_for(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    name, text = side.parameter(NODE, "large.text"), "x" * 100_000
    visitor.set_parameter(NODE, "large.text", text)
    assert inspector.ask(wire.GetParameter(name)).value.endswith("x… (100000 characters)")
    assert inspector.ask(wire.GetParameter(name, whole=True)).value == text
    assert text in str(inspector.ask(wire.GetAllParameters()).value)


def test_a_parameter_is_set_and_deleted_only_from_the_allow_list(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    greeting, lamp = side.parameter(NODE, "greeting"), side.parameter(NODE, "kitchen_lamp")
    for name in ("greeting", "farewell", "kitchen_lamp"):
        visitor.set_parameter(NODE, name, "before")
    assert inspector.ask(wire.SetParameter(greeting, "hello")).value == "hello"
    assert visitor.parameter(NODE, "greeting") == "hello"
    assert inspector.ask(wire.SetParameter(lamp, "hello")).refusal.code == "not_allowed"
    assert inspector.ask(wire.DeleteParameter(lamp)).refusal.code == "not_allowed"
    assert visitor.parameter(NODE, "kitchen_lamp") == "before"
    farewell = side.parameter(NODE, "farewell")
    assert inspector.ask(wire.DeleteParameter(farewell)).value is None
    assert inspector.ask(wire.GetParameter(farewell)).refusal.code == "no_parameter"
    assert inspector.ask(wire.DeleteParameter(farewell)).refusal.code == "no_parameter"


# --- services -------------------------------------------------------------------------------------------


def test_a_service_is_described_and_called_by_allow_list(
    inspector: InspectorProcess, serving: Serving
) -> None:
    with serving("/lamp", SWITCH, success=True, message="on") as requests:
        (field,) = inspector.ask(wire.DescribeService("/lamp")).fields
        assert field.name == "data" and field.type in ("bool", "boolean")
        called = inspector.ask(wire.CallService("/lamp", {"data": True}, seq=9))
        assert (called.fields, called.seq) == ({"success": True, "message": "on"}, 9)
        assert requests.next().data is True
        bad = inspector.ask(wire.CallService("/lamp", {"data": "bright"})).refusal
        assert (bad.code, bad.figures) == ("bad_field", {"path": "data"})
    with serving("/door", SWITCH):
        assert inspector.ask(wire.CallService("/door", {"data": True})).refusal.code == "not_allowed"


def test_another_service_of_that_name_is_not_called(
    side: Side, inspector: InspectorProcess, serving: Serving
) -> None:
    with serving("/lamp", TRIGGER):
        refusal = inspector.ask(wire.CallService("/lamp")).refusal
    assert (refusal.code, refusal.figures["type"]) == ("not_allowed", side.service_type(TRIGGER))


def test_a_whole_answer_is_not_shortened(inspector: InspectorProcess, serving: Serving) -> None:
    with serving("/slow", TRIGGER, message="y" * 3000):
        assert len(inspector.ask(wire.CallService("/slow")).fields["message"]) < 3000
        assert inspector.ask(wire.CallService("/slow", whole=True)).fields["message"] == "y" * 3000


def test_services_have_types_and_types_have_requests_and_responses(
    side: Side, inspector: InspectorProcess, serving: Serving
) -> None:
    kind = side.service_type(SWITCH)
    with serving("/lamp", SWITCH):
        types = inspector.ask(wire.ListServiceTypes(["/lamp", "/nobody"])).types
        assert types == {"/lamp": kind}
        assert inspector.ask(wire.ListServiceTypes()).types["/lamp"] == kind
        assert inspector.ask(wire.LocateService("/lamp")).host
    assert inspector.ask(wire.LocateService("/nobody")).host == ""
    request = inspector.ask(wire.DescribeServiceType(kind))
    response = inspector.ask(wire.DescribeServiceType(kind, response=True))
    assert [field.name for field in request.fields] == ["data"]
    assert [field.name for field in response.fields] == ["success", "message"]
    assert inspector.ask(wire.DescribeServiceType("nobody_srvs/Nothing")).refusal.code == "type_unknown"


def test_a_service_that_is_missing_is_reported(inspector: InspectorProcess) -> None:
    assert inspector.ask(wire.CallService("/slow")).refusal.code == "no_service"


# --- publishing -----------------------------------------------------------------------------------------


def order(side: Side, topic: str, kind: str, fields: dict[str, Any], hz: float = 0.0) -> wire.Publish:
    return wire.Publish(1, topic, side.type(kind), fields, hz)


def refusal_of(inspector: InspectorProcess, asked: wire.Publish) -> wire.Refusal | None:
    return inspector.done(lambda number: Check(number, asked))


def test_a_single_message_reaches_listeners_then_silence(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    note = order(side, "/notes", STRING, {"data": "Grüß Gott"})
    with visitor.listen("/notes", STRING) as notes:
        until(lambda: row_of(inspector, "/notes"), "the listener")
        assert refusal_of(inspector, note) is None
        inspector.send(note)
        assert notes.next().data == "Grüß Gott"
        inspector.send(note)
        notes.next()
        assert notes.drain() == []


def row_of(inspector: InspectorProcess, topic: str) -> wire.TopicRow | None:
    return next((row for row in inspector.ask(wire.ListTopics()).topics if row.name == topic), None)


def test_a_nested_message_is_published_at_a_rate_until_stop(
    side: Side, inspector: InspectorProcess, visitor: Visitor
) -> None:
    fields = {"pose.position": {"x": 1.5}, "pose.orientation.w": 1, "header": {"frame_id": "map"}}
    goal = order(side, "/visit_pose", POSE, fields, 20.0)
    with visitor.listen("/visit_pose", POSE) as goals:
        assert refusal_of(inspector, goal) is None
        inspector.send(goal)
        first, second = goals.next(), goals.next()
        assert inspector.done(lambda number: HaltPublishing(number, "/visit_pose")) is None
        goals.drain()
        with pytest.raises(AssertionError):
            goals.next(0.3)
    assert (first.pose.position.x, first.pose.orientation.w, first.header.frame_id) == (1.5, 1.0, "map")
    # Each message has its own stamp
    assert 0 < second.header.stamp - first.header.stamp < PATIENCE_S


def test_what_does_not_fit_or_is_not_listed_is_refused(side: Side, inspector: InspectorProcess) -> None:
    refusal = refusal_of(inspector, order(side, "/visit_pose", POSE, {"pose.position.x": "far"}))
    assert refusal and (refusal.code, refusal.figures) == ("bad_field", {"path": "pose.position.x"})
    for topic in ("/diary", "/lab/joy"):  # not even checked
        refusal = refusal_of(inspector, order(side, topic, STRING, {}))
        assert refusal and refusal.code == "not_allowed"


@pytest.mark.last
def test_with_stdin_everything_ends(side: Side, process: InspectorProcess, visitor: Visitor) -> None:
    def nodes() -> list[str]:
        return [node for node in visitor.listeners("/look/end") if INSPECTOR in node]

    note = order(side, "/notes", STRING, {"data": "on and on"}, 50.0)
    with visitor.listen("/notes", STRING) as notes, talking(visitor, "/look/end", "std_msgs/Empty"):
        assert refusal_of(process, note) is None
        process.send(note)
        process.subscribe(**{"look/end": 5.0})
        notes.next()
        process.shown("/look/end", lambda s: s.number)
        assert process.stop() == 0
        until(lambda: not nodes() and not notes.publishers, "the end of what it did")
