"""Publishing: only for the holder, recorded, on allow-listed topics; velocities only through the gate."""

import json
import threading
from concurrent.futures import Future
from types import SimpleNamespace

import msgspec
import pytest

from robots.bridge.audit.records import Requester
from robots.bridge.drive.drive_input import stick_of, velocity_of
from robots.bridge.tasks.publishing import Publications
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.configuration.gate_profile import Limits
from robots.shared.geometry.poses import STILL, Velocity
from robots.shared.messages.twists import velocity_from
from robots.shared.records.record_sink import Holder
from robots.shared.wire import Refusal
from tests.bridge.support import CONFIG, Bench, MemoryPublisher, Outcome, settled

NOTES = Allowed("publish", "/notes", "std_msgs/String")
SERVICE = Allowed("call", "/diary", "std_msgs/String")  # a service cannot be published
ALLOWING = msgspec.structs.replace(CONFIG, allowed=(NOTES, SERVICE))


@pytest.fixture
def bench():
    bench = Bench(config=ALLOWING).online()
    bench.granted().pass_time(0.3)
    return bench


def note(rate_hz=0.0, topic="/notes", type_name="std_msgs/String", fence=1):
    return wire.Publish(fence, topic, type_name, {"data": "hello"}, rate_hz)


def settled_after(bench, order):
    """The answers to a task, after its record."""
    answers = bench.ask(order)
    settled(bench)
    return answers


def shown(bench):
    return bench.core.state(bench.now_s, []).publishing


def test_message_is_sent_and_answered_after_its_record(bench):
    bench.sink.open.clear()
    answers = bench.ask(note())
    bench.core.tick(bench.now_s)
    assert (bench.publisher.published, answers) == ([], [])
    bench.sink.open.set()
    settled(bench)
    assert (bench.publisher.published, answers) == ([note()], [None])
    kind, parameters = bench.sink.records[0]
    assert kind == "publish.start"
    assert parameters["fields"] == '{"data":"hello"}'
    assert shown(bench) == []


def test_unrecorded_message_is_not_sent(bench):
    bench.sink.fails = "disk full"
    answers = bench.ask(note())
    settled(bench)
    assert bench.publisher.published == []
    assert [refusal.code for refusal in answers] == ["not_recorded"]


def test_halted_message_without_record_is_refused_and_not_sent(bench):
    bench.sink.open.clear()
    answers = bench.ask(note())
    bench.core.stop("Bob", "", bench.now_s)
    bench.sink.open.set()
    settled(bench)
    assert bench.publisher.published == []
    assert [refusal.code for refusal in answers] == ["halted"]
    assert bench.sink.records[-1] == ("publish.end", Outcome("stopped", topic="/notes", duration_s=0.0))


def test_single_message_is_recorded_as_sent(bench):
    bench.order(note())
    settled(bench)
    assert bench.sink.kinds == ["publish.start", "publish.end"]
    assert bench.sink.records[-1][1].outcome == "sent"


@pytest.mark.parametrize("rate_hz", [0.0, 5.0])
def test_unsent_message_is_neither_accepted_nor_recorded_as_sent(bench, rate_hz):
    bench.publisher.is_there = False
    [refusal] = settled_after(bench, note(rate_hz))
    assert refusal.code == "inspector_silent"
    assert bench.sink.records[-1] == (
        "publish.end",
        Outcome("inspector_silent", topic="/notes", duration_s=pytest.approx(0.0, abs=0.1)),
    )
    assert shown(bench) == []


@pytest.mark.parametrize("rate_hz", [1e-300, 0.05, -1.0, 51.0])
def test_a_rate_must_be_one_that_people_would_wait_for(rate_hz):
    raw = wire.encode(note(5.0)).replace(b'"rate_hz":5.0', f'"rate_hz":{rate_hz}'.encode())
    for door in (wire.browser_message, wire.link_request):
        with pytest.raises(wire.WireError) as caught:
            door(raw)
        assert caught.value.refusal.code == "invalid"


@pytest.mark.parametrize(
    "name",
    [
        "notes",
        "~notes",
        "//notes",
        "/notes/",
        "/a//notes",
        "/./notes",
        "/notes\n",
        "/n\u043etes",
        "/notes\u200b",
        "",
    ],
)
@pytest.mark.parametrize("kind", ["publish", "publish_stop", "call", "set_parameter"])
def test_no_door_takes_a_name_that_ros_would_resolve_to_another(kind, name):
    field = {"call": "service", "set_parameter": "name"}.get(kind, "topic")
    doors = (wire.topics_message,) if field != "topic" else (wire.browser_message, wire.link_request)
    message = {"t": kind, "fence": 1, "type": "std_msgs/String", "value": 1, "seq": 1}
    for door in doors:
        door(json.dumps(message | {field: "/notes"}))
        with pytest.raises(wire.WireError) as caught:
            door(json.dumps(message | {field: name}))
        assert caught.value.refusal.code == "invalid"


def test_publishing_at_a_rate_continues_until_stopped(bench):
    bench.order(note(5.0))
    settled(bench)
    assert shown(bench) == [wire.Publishing("/notes", "std_msgs/String", 5.0)]
    bench.pass_time(1.0)
    assert bench.order(wire.PublishStop(1, "/notes")) is None
    bench.recorded()
    assert bench.publisher.stopped == ["/notes"]
    kind, end = bench.sink.records[-1]
    assert (kind, end.outcome) == ("publish.end", "cancelled")
    assert end.duration_s == pytest.approx(1.0, abs=0.1)
    assert bench.order(wire.PublishStop(1, "/notes")).code == "not_publishing"


def test_next_message_replaces_publishing_at_a_rate(bench):
    bench.order(note(5.0))
    settled(bench)
    bench.order(note())
    settled(bench)
    bench.recorded()
    assert bench.sink.kinds == ["publish.start", "publish.start", "publish.end", "publish.end"]
    assert [end.outcome for _, end in bench.sink.records[-2:]] == ["replaced", "sent"]
    assert shown(bench) == []


@pytest.mark.parametrize(
    ("happens", "outcome"),
    [
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "control_ended"),
        (lambda bench: bench.core.link_lost(1, bench.now_s) or bench.pass_time(2.2), "link_lost"),
        (lambda bench: bench.core.close(bench.now_s), "bridge_ended"),
    ],
)
def test_stop_or_lost_holder_ends_publishing(bench, happens, outcome):
    bench.order(note(5.0))
    settled(bench)
    happens(bench)
    bench.recorded()
    assert bench.publisher.stopped == ["/notes"]
    assert bench.sink.records[-1][1].outcome == outcome
    assert shown(bench) == []


@pytest.mark.parametrize(
    ("order", "code"),
    [
        (note(topic="/other"), "not_allowed"),
        (note(topic="/diary"), "not_allowed"),
        (note(topic="/Notes"), "not_allowed"),
        (note(topic="/robot/notes"), "not_allowed"),
        (note(type_name="std_msgs/Bool"), "not_allowed"),
        (note(fence=2), "unknown_fence"),
    ],
)
def test_message_without_allowance_is_refused_unrecorded(bench, order, code):
    assert bench.order(order).code == code
    settled(bench)
    assert bench.publisher.published == []
    assert bench.sink.kinds == []


def test_wrong_field_is_refused_before_the_record(bench):
    bench.publisher.fault = Refusal("bad_field", "data is text.", "wire", {"path": "data"})
    assert bench.order(note()).figures == {"path": "data"}
    settled(bench)
    assert bench.sink.kinds == []


@pytest.mark.parametrize(
    ("happens", "code"),
    [
        (lambda bench: bench.core.revoke(1, "over", bench.now_s), "no_lease"),
        (lambda bench: bench.core.stop("Bob", "", bench.now_s), "stopped"),
    ],
)
def test_event_during_the_check_prevents_publishing(bench, happens, code):
    bench.publisher.waiting = []
    answers = bench.ask(note())
    happens(bench)
    [check] = bench.publisher.waiting
    check()
    assert [answer.code for answer in answers] == [code]
    settled(bench)
    assert bench.publisher.published == []


def test_stopped_robot_checks_no_fields(bench):
    bench.publisher.waiting = []
    bench.core.stop("Bob", "", bench.now_s)
    assert bench.order(note()).code == "stopped"
    assert bench.publisher.waiting == []


# --- velocities -----------------------------------------------------------------------------------


def twist(bench, vx, topic="/key_vel", rate_hz=0.0, age_s=0.0, type_name="geometry_msgs/Twist"):
    bench.seq += 1
    fields = {"linear.x": vx}
    sent_ms = (bench.now_s - age_s) * 1000.0
    return wire.Publish(1, topic, type_name, fields, rate_hz, sent_ms, bench.seq)


def driven(bench, vx, **more):
    """Request the twist before and after the drive is recorded; return the last answer."""
    bench.order(twist(bench, vx, **more))
    bench.recorded()
    bench.pass_time(0.05)
    return bench.order(twist(bench, vx, **more))


@pytest.mark.parametrize("type_name", ["geometry_msgs/Twist", "geometry_msgs/msg/Twist"])
def test_twist_passes_the_gate_and_expires_after_0_3_s(bench, type_name: str):
    asked = []
    decide = bench.gate.decide
    bench.gate.decide = lambda *what: asked.append(what[0]) or decide(*what)
    assert driven(bench, 0.3, type_name=type_name) is None
    assert bench.last == Velocity(pytest.approx(0.3), 0.0, 0.0)
    assert asked[-1] == bench.last
    bench.pass_time(0.35)
    assert bench.last == STILL
    assert bench.publisher.published == []


def test_a_twist_asks_for_no_more_than_the_holders_share():
    bench = Bench(config=ALLOWING).online()
    bench.core.grant(wire.Grant(1, 60.0, "session-1", "Ann", "ann-id", 0.5), 1, bench.now_s)
    bench.stick(0.0)
    bench.pass_time(0.3)
    driven(bench, 5.0)
    assert bench.last.vx == pytest.approx(0.5 * CONFIG.gate.limits.forward_mps)
    bench.order(twist(bench, 0.3))
    assert bench.last.vx == pytest.approx(0.3)


def test_a_stick_that_is_moved_goes_before(bench):
    driven(bench, 0.3)
    bench.stick(-1.0)
    assert bench.last.vx == pytest.approx(-CONFIG.gate.limits.reverse_mps)


def test_twist_still_sent_after_a_stop_does_not_drive(bench):
    driven(bench, 0.3)
    bench.core.stop("Bob", "", bench.now_s)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    bench.stick(0.0)
    assert bench.order(twist(bench, 0.3)).code == "neutral_needed"
    assert bench.last == STILL


def test_resting_program_does_not_free_a_stick_not_in_the_middle(bench):
    bench.driving(0.5)
    for _ in range(10):  # the page is frozen with its stick held out
        bench.order(twist(bench, 0.0))
        bench.pass_time(0.05)
    needed = bench.core.state(bench.now_s, []).neutral_needed
    assert needed.code == "dead_man" and "no command" in needed.text
    assert bench.stick(0.5).code == "neutral_needed"
    bench.core.stop("Bob", "", bench.now_s)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    bench.order(twist(bench, 0.0))
    assert bench.stick(0.5).code == "neutral_needed"
    assert bench.last == STILL
    bench.stick(0.0)
    assert bench.stick(0.5) is None


def test_resting_stick_does_not_free_a_silent_program(bench):
    driven(bench, 0.3)
    bench.stick(0.0)
    bench.pass_time(0.4)
    bench.stick(0.0)
    assert bench.core.state(bench.now_s, []).neutral_needed is None  # the stick may drive
    refusal = bench.order(twist(bench, 0.3))
    assert refusal.text == "Publish a velocity of zero first: no command came for 0.3 s."
    assert bench.last == STILL
    bench.order(twist(bench, 0.0))
    assert bench.order(twist(bench, 0.3)) is None


def test_a_stick_that_dies_while_out_hands_over_to_no_tool(bench):
    bench.driving(0.5)
    for _ in range(10):
        refusal = bench.order(twist(bench, 0.3))
        bench.pass_time(0.05)
    assert refusal.code == "neutral_needed"
    assert bench.last == STILL


def test_program_started_while_stick_was_out_waits_after_stop(bench):
    bench.driving(0.5)
    bench.stick(0.5)
    bench.order(twist(bench, 0.3))  # the stick is driving
    bench.core.stop("Bob", "", bench.now_s)
    bench.core.clear(bench.core.stop_state.number, bench.now_s)
    for _ in range(10):
        bench.stick(0.0)
        assert bench.order(twist(bench, 0.3)).code == "neutral_needed"
        bench.pass_time(0.05)
    assert bench.last == STILL
    bench.order(twist(bench, 0.0))
    assert bench.order(twist(bench, 0.3)) is None


def test_a_twist_of_unknown_age_is_refused(bench):
    fields = {"linear.x": 0.3}
    assert bench.order(wire.Publish(1, "/key_vel", "geometry_msgs/Twist", fields)).code == "invalid"
    assert bench.last == STILL


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"topic": "/cmd_vel"}, "around_the_gate"),
        ({"type_name": "geometry_msgs/TwistStamped"}, "around_the_gate"),
        ({"rate_hz": 10.0}, "dead_man"),
        ({"age_s": 0.5}, "too_old"),
    ],
)
def test_a_twist_by_another_way_is_refused(bench, changes, code):
    bench.order(twist(bench, 0.0))
    assert bench.order(twist(bench, 0.3, **changes)).code == code
    assert bench.last == STILL


@pytest.mark.parametrize(
    ("fields", "path"),
    [
        ({"linear": {"x": "fast"}}, "linear.x"),
        ({"linear.x": float("nan")}, "linear.x"),
        ({"linear.x": True}, "linear.x"),
        ({"angular.x": 0.1}, "angular.x"),
        ({"speed": 1.0}, "speed"),
    ],
)
def test_a_field_that_is_no_velocity_of_a_base_is_named(fields, path):
    refusal = velocity_from(fields, "geometry_msgs/Twist")
    assert isinstance(refusal, Refusal)
    assert refusal.figures == {"path": path}


def test_a_stamped_twist_is_read_below_its_header():
    fields = {"header": {"seq": 1}, "twist": {"linear": {"x": 0.2}, "angular": {"z": -1}}}
    assert velocity_from(fields, "geometry_msgs/TwistStamped") == Velocity(0.2, 0.0, -1.0)
    assert velocity_from({"linear.x": 0.2}, "geometry_msgs/TwistStamped").figures == {"path": "linear"}


@pytest.mark.parametrize("steering", ["turn", "car"])
@pytest.mark.parametrize(
    "velocity", [Velocity(0.3, 0.0, 0.5), Velocity(-0.1, 0.0, 0.5), Velocity(0.0, 0.1, 0.0)]
)
def test_a_stick_position_for_a_velocity_asks_for_that_velocity(steering, velocity):
    limits = Limits(1.0, 0.2, 0.3, 2.0, 1.0, 2.0)
    stick = stick_of(velocity, limits, 0.8, steering)
    drive = wire.Drive(1, 1, 0.0, stick.x, stick.w, stick.y, share=1.0)
    assert velocity_of(drive, limits, 0.8, steering) == pytest.approx(velocity)


def test_recorded_message_is_sent_before_the_next_tick(bench):
    opened = threading.Event()
    bench.records.open(opened.set, bench.now_s)
    bench.order(note())
    assert opened.wait(10.0)
    bench.core.recorded(bench.now_s)
    assert bench.publisher.published == [note()]


def test_velocities_go_only_to_the_chosen_drive_topic(bench, monkeypatch):
    monkeypatch.setattr(bench.core.tasks.routing, "topic", {"drive": "/phone_vel"}.get)
    assert bench.order(twist(bench, 0.0, "/phone_vel")) is None
    refusal = bench.order(twist(bench, 0.3, "/key_vel"))
    assert refusal.code == "around_the_gate"
    assert refusal.figures["topic"] == "/phone_vel"


@pytest.mark.parametrize(
    ("fields", "path"),
    [
        ({"linear.x": 0.1, "linear": {"x": 0.2}}, "linear.x"),
        ({"twist.linear.x": 0.1, "header.bogus": 1}, "header.bogus"),
        ({"twist.linear.z": 0.1}, "twist.linear.z"),
        ({"header.stamp": 1e300}, "header.stamp"),
    ],
)
def test_bad_velocity_fields_are_refused(fields, path):
    type_name = "geometry_msgs/Twist" if "linear" in fields else "geometry_msgs/TwistStamped"
    assert velocity_from(fields, type_name).figures == {"path": path}


class Arriving(Future):
    """A record that is written just after its first check."""

    looks = 0

    def done(self):
        self.looks += 1
        return self.looks > 1


def test_late_record_is_sent_one_tick_later():
    number, publisher, answers = Arriving(), MemoryPublisher(lambda: 0.0), []
    number.set_result(1)
    records = SimpleNamespace(request=lambda *_arguments: number, outcome=lambda *_arguments: None)
    rules = SimpleNamespace(why_not_begin=lambda *_arguments: None)
    publications = Publications(SimpleNamespace(publisher=publisher, records=records, rules=rules))
    publications.begin(note(), Requester(Holder("ann-id", "Ann", "session-1", 1), 1, answers.append), 0.0)
    for now_s in (0.05, 0.1):
        publications.tick(now_s)
    assert (publisher.published, answers) == ([note()], [None])
