"""The topics WebSocket: queries, service calls, subscriptions."""

import time

import msgspec
import pytest

from fleet.audit.integrity.canonical import TEXT_BYTES
from fleet.audit.models import Record
from robots.registry.models import Robot, RobotRole
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from teleop.background.database import in_database
from teleop.live.consumers.message_socket import CloseCode
from teleop.live.consumers.topics_consumer import MAX_PENDING, QUERIES_BURST
from teleop.live.topic_feed import MAX_SUBSCRIPTIONS
from tests.teleop.support import Page, eventually

pytestmark = pytest.mark.django_db(transaction=True)

LONGEST_S = 3.0  # the console checks twice a second; a busy computer needs longer
ALLOWED = (
    Allowed(
        "call", "/clear_costmaps", "std_srvs/Empty", "", "operator"
    ),  # the admin's form does not allow this
    Allowed("set", "/volume", "", "", "operator"),
)


@pytest.fixture(autouse=True)
def allowed(allow):
    """The content of the allow-list."""
    allow(*ALLOWED)


@pytest.fixture
async def open_topics(robot, browsers, websocket_headers, bridge):
    """`await open_topics("observer")`: that person's connection to the topics of `robot`."""
    opened = []

    async def open_one(who, slug=robot.slug):
        page = Page(websocket_headers(browsers[who]), f"/ws/robots/{slug}/topics/")
        opened.append(page)
        return await page.open()

    yield open_one
    for page in opened:
        await page.close()


# --- access -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("slug", ["tiago-1", "no-such-robot"])
async def test_stranger_does_not_learn_that_the_robot_exists(slug, open_topics):
    page = await open_topics("stranger", slug)
    assert await page.is_closed() == CloseCode.NOT_FOUND


async def test_page_of_another_origin_is_refused(robot, browsers, websocket_headers, bridge):
    headers = [
        (name, b"http://elsewhere.example" if name == b"origin" else value)
        for name, value in websocket_headers(browsers["staff"])
    ]
    page = Page(headers, f"/ws/robots/{robot.slug}/topics/")
    await page._socket.send_input({"type": "websocket.connect"})
    assert (await page._event())["type"] == "websocket.close"


async def test_person_who_loses_the_role_is_disconnected(open_topics, bridge, observer):
    page = await open_topics("observer")
    await page.say("subscribe", topic="/odom")
    await bridge.hears(wire.LinkSubscribe)
    begun_s = time.monotonic()
    await in_database(lambda: RobotRole.objects.filter(user=observer).delete())
    assert await page.is_closed() == CloseCode.NOT_PERMITTED
    assert time.monotonic() - begun_s < LONGEST_S
    await bridge.hears(wire.LinkSubscribe, lambda look: not look.topics)


async def test_person_who_signs_out_is_disconnected(open_topics, browsers, end_session):
    page = await open_topics("observer")
    begun_s = time.monotonic()
    await in_database(end_session, browsers["observer"])
    assert await page.is_closed() == CloseCode.SIGNED_OUT
    assert time.monotonic() - begun_s < LONGEST_S


# --- queries --------------------------------------------------------------------------------------------


async def test_query_reaches_the_bridge_and_its_answer_the_page(open_topics, bridge):
    graph = wire.Graph([wire.TopicRow("/odom", "nav_msgs/Odometry", ["/base"])], [], [], seq=5)
    bridge.answer = lambda ask: graph
    page = await open_topics("observer")
    await page.say("topics", seq=5)
    await page.hears("graph", seq=5)
    assert page.last_raw == wire.encode(graph).decode()


async def test_answer_reaches_the_connection_that_asked(open_topics, bridge):
    bridge.answer = lambda ask: wire.Parameter(ask.name, 1, ask.seq)
    first, second = await open_topics("observer"), await open_topics("operator")
    await first.say("parameter", name="/first", seq=1)
    await second.say("parameter", name="/second", seq=1)
    assert (await first.hears("parameter_value"))["name"] == "/first"
    assert (await second.hears("parameter_value"))["name"] == "/second"


async def test_refusal_of_the_robot_is_passed_on(open_topics, bridge):
    refusal = wire.Refusal("unknown_type", "No such type.", "robot")
    bridge.answer = lambda ask: wire.Refused("describe", refusal, ask.seq)
    page = await open_topics("observer")
    await page.say("describe", type="a/B", seq=2)
    assert (await page.hears("refused", of="describe", seq=2))["refusal"]["code"] == "unknown_type"


async def test_query_refused_by_the_bridge_is_answered(open_topics, bridge):
    bridge.silent = True
    page = await open_topics("observer")
    await page.say("parameters", seq=2)
    asked = await bridge.hears(wire.LinkQuery)
    bridge.say(wire.Refused("inspect", wire.Refusal("inspector_silent", "No answer.", "robot"), asked.seq))
    refused = await page.hears("refused", of="parameters", seq=2)
    assert refused["refusal"]["code"] == "inspector_silent"


async def test_bridge_without_answer_is_reported_as_silent(open_topics, bridge, monkeypatch):
    monkeypatch.setattr("robots.link.client._QUERY_TIMEOUT_S", 0.05)
    bridge.silent = True
    page = await open_topics("observer")
    await page.say("parameters", seq=2)
    assert (await page.hears("refused", of="parameters", seq=2))["refusal"]["code"] == "bridge_silent"


async def test_queries_without_a_bridge_are_refused(open_topics, bridge):
    await bridge.close()
    page = await open_topics("observer")
    assert (await page.hears("bridge_gone"))["refusal"]["code"] == "bridge_down"
    await page.say("topics", seq=1)
    assert (await page.hears("refused", of="topics", seq=1))["refusal"]["code"] == "bridge_down"


async def test_pending_query_is_answered_when_the_link_breaks(open_topics, bridge):
    bridge.silent = True
    page = await open_topics("observer")
    await page.say("topics", seq=1)
    await bridge.hears(wire.LinkQuery)
    bridge.cut()
    assert (await page.hears("refused", of="topics", seq=1))["refusal"]["code"] == "bridge_down"


async def test_pending_queries_are_limited(open_topics, bridge):
    bridge.silent = True
    page = await open_topics("observer")
    for seq in range(1, MAX_PENDING + 2):
        await page.say("topics", seq=seq)
    assert (await page.hears("refused", seq=MAX_PENDING + 1))["refusal"]["code"] == "busy"
    await bridge.hears(wire.LinkQuery, count=MAX_PENDING)


async def test_frequent_queries_are_slowed_down(open_topics, bridge):
    page = await open_topics("observer")
    for seq in range(1, int(QUERIES_BURST) + 1):
        await page.say("parameters", seq=seq)
        await page.hears("parameter_names", seq=seq)
    for seq in range(100, 110):
        await page.say("parameters", seq=seq)
    await page.refused("busy")


@pytest.mark.parametrize(
    ("raw", "code"),
    [
        ('{"t":"fly","seq":3}', "invalid"),
        ('{"t":"say","fence":1,"seq":3,"text":"Hi","language":"en"}', "invalid"),
        ('{"t":"subscribe","seq":3,"topic":"no name"}', "invalid"),
        ('{"t":"subscribe","seq":3,"topic":"/odom","rate_hz":1000}', "invalid"),
        ('{"t":"call","seq":3,"service":"/a","fields":{"a":' + "[" * 40 + "]" * 40 + "}}", "invalid"),
        ("go!", "not_json"),
        ('{"t":"topics","seq":3,"padding":"' + "x" * 9000 + '"}', "too_large"),
    ],
)
async def test_malformed_message_is_refused_and_keeps_the_connection(raw, code, open_topics, bridge):
    page = await open_topics("staff")
    await page.say_raw(raw)
    refused = await page.refused(code)
    assert refused.get("seq") == (3 if code == "invalid" else None)
    await page.say("parameters", seq=4)
    await page.hears("parameter_names", seq=4)


# --- services and parameters ------------------------------------------------------------------------------


@pytest.fixture
async def staff_in_control(open_page, open_topics):
    """The topics of a member of staff who has control."""
    await (await open_page("staff")).take()
    return await open_topics("staff")


CALL = {"t": "call", "service": "/clear_costmaps", "fields": {"a": 1}}
SET = {"t": "set_parameter", "name": "/volume", "value": 50}


@pytest.mark.parametrize("question", [CALL, SET])
async def test_only_staff_call_services_and_set_parameters(question, open_topics, bridge):
    page = await open_topics("supervisor")
    await page.say(**question, seq=1)
    refused = await page.hears("refused", of=question["t"], seq=1)
    assert refused["refusal"]["code"] == "role_too_low"
    assert not bridge.all(wire.LinkQuery)


@pytest.mark.parametrize("question", [CALL | {"service": "/shutdown"}, SET | {"name": "/use_sim_time"}])
async def test_staff_are_bound_to_the_allow_list(question, open_topics, bridge):
    page = await open_topics("staff")
    await page.say(**question, seq=1)
    refused = await page.hears("refused", of=question["t"], seq=1)
    assert refused["refusal"]["code"] == "not_allowed"
    assert not bridge.all(wire.LinkQuery)
    assert not await in_database(Record.objects.filter(kind__in=["service.call", "parameter.set"]).exists)


@pytest.mark.parametrize(
    ("question", "kind", "parameters"),
    [
        (CALL, "service.call", {"service": "/clear_costmaps", "fields": {"a": 1}}),
        (SET, "parameter.set", {"name": "/volume", "value": 50}),
    ],
)
async def test_call_is_recorded_before_it_is_sent(
    question, kind, parameters, staff_in_control, bridge, staff, robot
):
    bridge.silent = True
    page = staff_in_control
    await page.say(**question, seq=1)
    asked = await bridge.hears(wire.LinkQuery)
    begun = await in_database(lambda: Record.objects.select_related("content").get(kind=kind))
    assert (begun.kind, begun.details, begun.outcome) == (kind, parameters, "")
    assert (begun.actor_id, begun.robot_id) == (str(staff.pk), robot.id)
    refusal = wire.Refusal("service_failed", "It said no.", "robot")
    answer = wire.encode(wire.Refused(question["t"], refusal, 1))
    bridge.say(wire.LinkAnswer(asked.seq, msgspec.Raw(answer)))
    await page.hears("refused", of=question["t"], seq=1)
    outcome = await eventually(lambda: Record.objects.filter(of=begun).first())
    details = await in_database(lambda: outcome.details)
    assert (outcome.outcome, details) == ("service_failed", {"words": "It said no."})


async def test_outcome_of_a_call_is_recorded_after_the_page_closed(staff_in_control, open_topics, bridge):
    bridge.silent = True
    page = staff_in_control
    await page.say(**CALL, seq=1)
    asked = await bridge.hears(wire.LinkQuery)
    await open_topics("observer")  # keeps the hub open
    await page.close()
    answer = wire.encode(wire.Called("/clear_costmaps", {}, 1))
    bridge.say(wire.LinkAnswer(asked.seq, msgspec.Raw(answer)))
    outcome = await eventually(lambda: Record.objects.filter(kind="service.call").exclude(of=None).first())
    assert outcome.outcome == "done"


async def test_record_of_a_long_call_has_its_beginning(staff_in_control, bridge):
    page = staff_in_control
    await page.say("call", service="/clear_costmaps", fields={"a": "x" * 5000}, seq=1)
    await bridge.hears(wire.LinkQuery)
    (kept,) = await in_database(
        lambda: [record.details["fields"] for record in Record.objects.filter(kind="service.call", of=None)]
    )
    assert kept.startswith('{"a":"xx') and kept.endswith("x… [cut: 5008 bytes]")
    assert len(kept.encode()) == TEXT_BYTES


async def test_call_that_cannot_be_recorded_is_not_sent(staff_in_control, bridge, disk):
    page = staff_in_control
    await in_database(disk.fill)
    await page.say("call", service="/clear_costmaps", fields={"a": "x" * 5000}, seq=1)
    refused = await page.hears("refused", of="call", seq=1)
    assert refused["refusal"]["rule"] == "audit"
    assert not bridge.all(wire.LinkQuery)


# --- subscriptions-----------------------------------------------------------------------------------------------


async def test_subscriber_gets_the_newest_sample_after_each_ack(open_topics, bridge):
    page = await open_topics("observer")
    await page.say("subscribe", topic="/odom", rate_hz=10)
    assert (await bridge.hears(wire.LinkSubscribe)).topics == {"/odom": 10.0}
    sent = bridge.shows("/odom", 1)
    await page.hears("sample")
    assert page.last_raw == sent
    bridge.shows("/odom", 2)
    bridge.shows("/odom", 3)
    await page.hears_nothing("sample")
    await page.say("ack")
    assert (await page.hears("sample"))["number"] == 3


async def test_bridge_gets_all_subscriptions_in_one_message(open_topics, bridge):
    first, second = await open_topics("observer"), await open_topics("operator")
    await first.say("subscribe", topic="/odom", rate_hz=2)
    await bridge.hears(wire.LinkSubscribe, lambda look: look.topics == {"/odom": 2.0})
    await second.say("subscribe", topic="/odom", rate_hz=5)
    await bridge.hears(wire.LinkSubscribe, lambda look: look.topics == {"/odom": 5.0})
    await second.say("subscribe", topic="/scan", rate_hz=1)
    await bridge.hears(wire.LinkSubscribe, lambda look: look.topics == {"/odom": 5.0, "/scan": 1.0})
    await second.close()
    await bridge.hears(wire.LinkSubscribe, lambda look: look.topics == {"/odom": 2.0})
    await first.say("unsubscribe", topic="/odom")
    await bridge.hears(wire.LinkSubscribe, lambda look: look.topics == {})


async def test_frequent_changes_of_topics_are_collected(open_topics, bridge):
    page = await open_topics("observer")
    for number in range(100):
        await page.say("subscribe", topic=f"/topic{number}")
        await page.say("unsubscribe", topic=f"/topic{number}")
    await page.say("subscribe", topic="/odom")
    await bridge.hears(wire.LinkSubscribe, lambda look: look.topics == {"/odom": 5.0})
    assert len(bridge.all(wire.LinkSubscribe)) < 30


async def test_newcomer_gets_the_newest_sample_at_once(open_topics, bridge):
    first, second = await open_topics("observer"), await open_topics("operator")
    await first.say("subscribe", topic="/map")
    await bridge.hears(wire.LinkSubscribe)
    bridge.shows("/map", 1)
    assert (await first.hears("sample"))["number"] == 1
    await second.hears_nothing("sample")
    await second.say("subscribe", topic="/map")
    assert (await second.hears("sample"))["number"] == 1


async def test_restarted_bridge_gets_the_subscriptions_again(open_topics, bridge):
    page = await open_topics("observer")
    await page.say("subscribe", topic="/odom")
    await bridge.hears(wire.LinkSubscribe)
    bridge.cut()
    assert (await bridge.hears(wire.LinkSubscribe, count=2)).topics == {"/odom": 5.0}
    bridge.shows("/odom", 1)
    await page.hears("sample")


async def test_robot_with_a_new_address_keeps_its_subscriptions(open_topics, bridge, monkeypatch):
    page = await open_topics("observer")
    await page.say("subscribe", topic="/odom")
    await bridge.hears(wire.LinkSubscribe)
    await in_database(lambda: Robot.objects.update(bridge_address="wss://127.0.0.1:9"))
    await page.hears("bridge_gone")


async def test_too_many_subscriptions_are_refused(open_topics, bridge):
    page = await open_topics("observer")
    for number in range(MAX_SUBSCRIPTIONS):
        await page.say("subscribe", topic=f"/topic{number}")
    await page.say("subscribe", topic="/one_more")
    refused = await page.hears("refused", of="subscribe")
    assert refused["refusal"]["code"] == "too_many_subscriptions"
    assert refused["refusal"]["figures"] == {"topic": "/one_more", "limit": MAX_SUBSCRIPTIONS}
    await page.say("subscribe", topic="/topic1", rate_hz=1)  # another rate is no new subscription
    await page.say("unsubscribe", topic="/topic0")
    await page.say("subscribe", topic="/one_more")
    await bridge.hears(wire.LinkSubscribe, lambda look: "/one_more" in look.topics)


async def test_all_subscriptions_fit_into_one_message(open_topics, bridge):
    long = "/" + "x" * 190
    for number in range(wire.MOST_SUBSCRIPTIONS):
        if number % MAX_SUBSCRIPTIONS == 0:
            page = await open_topics("observer")
        await page.say("subscribe", topic=f"{long}{number}", rate_hz=3.3333333333333335)
    await bridge.hears(wire.LinkSubscribe, lambda look: len(look.topics) == wire.MOST_SUBSCRIPTIONS)
    page = await open_topics("observer")
    await page.say("subscribe", topic="/one_more")
    assert (await page.hears("refused"))["refusal"]["code"] == "too_many_subscriptions"
    await page.say("subscribe", topic=f"{long}0")  # another connection subscribes to it already
    bridge.shows(f"{long}0", 1)
    await page.hears("sample")
