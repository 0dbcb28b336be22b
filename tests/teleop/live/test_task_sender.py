"""Task requests of a page: checks of role and allow-list, and one answer to each."""

import asyncio
import threading

import pytest

from fleet.audit.models import Record
from robots.places.models import Place
from robots.registry.models import Allowance, RobotRole
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from teleop.background.database import in_database
from teleop.live import task_sender
from teleop.live.task_sender import MAX_PENDING
from tests.teleop.support import eventually

pytestmark = pytest.mark.django_db(transaction=True)

FENCE = 1
ORDERS = {
    "look_ahead": {},
    "forget": {},
    "play": {"motion": "wave"},
    "play_cancel": {},
    "say": {"text": "Hola", "language": "es"},
    "say_cancel": {},
    "drive_by": {"distance_m": 1.0},
    "drive_by_cancel": {},
    "go": {"x": 1.0, "y": 2.0, "heading": 0.5},
    "go_cancel": {},
    "set_pose": {"x": 1.0, "y": 2.0, "heading": 0.5},
    "move_limb": {"limb": "gripper", "to_m": 0.05},
    "limb_cancel": {"limb": "gripper"},
    "choose": {"use": "drive"},
    "publish_stop": {"topic": "/notes"},
}
ALLOWED = (
    Allowed("choose", "/phone_vel", "geometry_msgs/Twist", "drive", "operator"),
    Allowed("choose", "/nav_vel", "geometry_msgs/Twist", "drive", "supervisor"),
    Allowed("choose", "/other_tts", "pal_interaction_msgs/TtsAction", "speech", "operator"),
    Allowed("publish", "/notes", "std_msgs/String", "", "operator"),
    Allowed("publish", "/lights", "std_msgs/Bool", "", "staff"),
    Allowed("call", "/diary", "std_msgs/String", "", "operator"),
)


@pytest.fixture(autouse=True)
def allowed(allow):
    """The content of the allow-list."""
    allow(*ALLOWED)


@pytest.mark.parametrize("kind", ORDERS)
async def test_holders_request_reaches_the_bridge_and_is_answered(kind, holder, bridge):
    await holder.say(kind, fence=FENCE, seq=41, **ORDERS[kind])
    await holder.hears("accepted", of=kind, seq=41, fence=FENCE)
    bridge.refuses_tasks = wire.Refusal("stopped", "The robot is stopped.", "stop")
    await holder.say(kind, fence=FENCE, seq=42, **ORDERS[kind])
    refused = await holder.hears("refused", of=kind, seq=42, fence=FENCE)
    assert refused["refusal"]["code"] == "stopped"


async def test_a_drive_cancelled_while_its_place_is_read_never_begins(holder, bridge, monkeypatch):
    reading, may_end = threading.Event(), threading.Event()

    def read(_robot_id, name):
        reading.set()
        may_end.wait(10.0)
        return Place(name=name, x_m=1.0, y_m=1.0, map_id="0" * 64)

    monkeypatch.setattr(task_sender, "place_of_robot", read)
    await holder.say("go", fence=FENCE, seq=51, place="kitchen", **ORDERS["go"])
    await asyncio.to_thread(reading.wait, 10.0)
    await holder.say("go_cancel", fence=FENCE, seq=52)
    await holder.hears("accepted", of="go_cancel", seq=52)
    may_end.set()
    refused = await holder.hears("refused", of="go", seq=51)
    assert refused["refusal"]["code"] == "cancelled"


@pytest.mark.parametrize("kind", ORDERS)
async def test_request_without_control_is_refused(kind, holder, open_page, bridge):
    await holder.say(kind, fence=FENCE + 1, seq=7, **ORDERS[kind])
    refused = await holder.hears("refused", of=kind, seq=7, fence=FENCE + 1)
    assert refused["refusal"]["code"] == "old_fence"
    other = await open_page("second")
    await other.say(kind, fence=FENCE, seq=8, **ORDERS[kind])
    refused = await other.hears("refused", of=kind, seq=8, fence=FENCE)
    assert refused["refusal"]["code"] == "no_lease"
    assert not [message for message in bridge.heard if isinstance(message, wire.TaskRequest)]


async def test_every_request_is_answered_after_many_refusals(holder, bridge):
    for seq in range(60):
        await holder.say("play", fence=FENCE + 1, motion="wave", seq=seq)
    for seq in range(60):
        await holder.hears("refused", of="play", seq=seq)


async def test_malformed_request_is_refused_with_kind_and_number(holder, bridge):
    await holder.say("say", fence=FENCE, text="Hola", language="not a language", seq=9)
    assert (await holder.hears("refused", of="say", seq=9))["refusal"]["code"] == "invalid"
    await holder.say("fly", seq=10)
    assert (await holder.hears("refused", of="fly", seq=10))["refusal"]["code"] == "invalid"


@pytest.mark.parametrize(
    "fields",
    ['{"a":' * 30 + "1" + "}" * 30, '{"a":' + "[" * 3000 + "]" * 3000 + "}", '{"a":' * 900 + "1" + "}" * 900],
)
async def test_endlessly_nested_fields_keep_the_connection(fields, holder, bridge):
    await holder.say_raw(
        '{"t":"publish","seq":3,"fence":1,"topic":"/notes","type":"a/B","fields":%s}' % fields  # noqa: UP031
    )
    refused = await holder.hears("refused")
    assert refused["refusal"]["code"] in ("invalid", "not_json")
    await holder.say("play", fence=FENCE, motion="wave", seq=4)
    await holder.hears("accepted", seq=4)


async def test_text_too_long_for_the_link_is_refused_here(holder, bridge):
    await holder.say_raw('{"t":"say","fence":1,"seq":5,"language":"zh","text":"' + "说" * 3900 + '"}')
    assert (await holder.hears("refused", of="say", seq=5))["refusal"]["code"] == "too_large"
    assert not bridge.all(wire.Say)


async def test_requests_of_two_pages_with_one_number_stay_apart(holder, open_page, bridge):
    supervisor = await open_page("supervisor")
    bridge.silent = True
    await holder.say("play_cancel", fence=FENCE, seq=1)
    await bridge.hears(wire.PlayCancel)
    await supervisor.say("play_cancel", seq=1)
    cancel = await bridge.hears(wire.LinkCancel)
    bridge.say(wire.Refused("link_cancel", wire.Refusal("no_motion", "None runs.", "robot"), cancel.seq))
    bridge.say(wire.Accepted("play_cancel", 1, FENCE))
    assert (await supervisor.hears("refused", of="play_cancel", seq=1))["refusal"]["code"] == "no_motion"
    await holder.hears("accepted", of="play_cancel", seq=1, fence=FENCE)
    assert "accepted" not in [message["t"] for message in supervisor.inbox]


async def test_pending_request_is_answered_when_the_link_breaks(holder, bridge):
    bridge.silent = True
    await holder.say("play", fence=FENCE, motion="wave", seq=2)
    await bridge.hears(wire.Play)
    bridge.cut()
    assert (await holder.hears("refused", of="play", seq=2))["refusal"]["code"] == "bridge_down"


async def test_request_without_bridge_is_refused_at_once(holder, bridge):
    await bridge.close()
    await holder.hears("bridge_gone")
    await holder.say("say", fence=FENCE, text="Hola", language="es", seq=3)
    assert (await holder.hears("refused", of="say", seq=3))["refusal"]["code"] == "bridge_down"


async def test_unanswered_requests_do_not_pile_up(holder, bridge):
    bridge.silent = True
    for seq in range(1, MAX_PENDING + 2):
        await holder.say("play", fence=FENCE, motion="wave", seq=seq)
    assert (await holder.hears("refused", of="play", seq=MAX_PENDING + 1))["refusal"]["code"] == "busy"
    await bridge.hears(wire.Play, count=MAX_PENDING)
    await holder.say("look_ahead", fence=FENCE, seq=99)
    assert (await holder.hears("refused", seq=99))["refusal"]["code"] == "busy"


async def test_drive_input_waits_for_no_request(holder, bridge):
    bridge.silent = True
    await holder.say("play", fence=FENCE, motion="wave", seq=1)
    await holder.say("drive", fence=FENCE, seq=2, sent_ms=1.0, x=0.5, w=0.0)
    assert (await bridge.hears(wire.Drive)).seq == 2


# --- cancelling without control ---------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "what"), [("play_cancel", "motion"), ("say_cancel", "speech")])
@pytest.mark.parametrize("who", ["supervisor", "staff"])
async def test_supervisors_and_staff_cancel_without_control(kind, what, who, holder, open_page, bridge):
    page = await open_page(who)
    await page.say(kind, seq=5)
    await page.hears("accepted", of=kind, seq=5)
    cancel = await bridge.hears(wire.LinkCancel)
    assert (cancel.what, cancel.by) == (what, {"supervisor": "Sue Pervisor", "staff": "Sam Staff"}[who])
    assert await eventually(lambda: Record.objects.filter(kind=f"{what}.cancel", outcome="accepted").exists())


@pytest.mark.parametrize("kind", ["play_cancel", "say_cancel"])
@pytest.mark.parametrize("who", ["second", "observer"])
async def test_other_people_do_not_cancel_without_control(kind, who, holder, open_page, bridge):
    page = await open_page(who)
    await page.say(kind, seq=5)
    assert (await page.hears("refused", of=kind, seq=5))["refusal"]["code"] == "no_lease"
    assert not bridge.all(wire.LinkCancel)


# --- allow-list -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "fields", "code"),
    [
        ("choose", {"use": "drive", "topic": "/phone_vel"}, None),
        ("choose", {"use": "drive", "topic": "/nav_vel"}, "role_too_low"),
        ("choose", {"use": "drive", "topic": "/other_tts"}, "not_allowed"),
        ("choose", {"use": "speech", "topic": "/other_tts"}, None),
        ("choose", {"use": "speech", "topic": "/tts"}, None),
        ("choose", {"use": "motions"}, None),
        ("say", {"text": "Hi", "language": "en", "topic": "/tts"}, None),
        ("say", {"text": "Hi", "language": "en", "topic": "/other_tts"}, None),
        ("say", {"text": "Hi", "language": "en", "topic": "/third_tts"}, "not_allowed"),
        ("publish", {"topic": "/notes", "type": "std_msgs/String"}, None),
        ("publish", {"topic": "/notes", "type": "std_msgs/Bool"}, "not_allowed"),
        ("publish", {"topic": "/diary", "type": "std_msgs/String"}, "not_allowed"),
        ("choose", {"use": "drive", "topic": "/tts"}, "not_allowed"),
        ("publish", {"topic": "/other", "type": "geometry_msgs/Twist"}, None),  # refused by real bridges
        ("publish", {"topic": "/lights", "type": "std_msgs/Bool"}, "role_too_low"),
        ("publish", {"topic": "/key_vel", "type": "geometry_msgs/Twist"}, None),
    ],
)
async def test_topics_must_be_on_the_allow_list_for_the_role(kind, fields, code, open_page, bridge):
    bridge.offers = wire.Offers(uses={"speech": wire.UseOffer("/tts", "pal_interaction_msgs/TtsAction")})
    holder = await open_page("operator")
    await holder.say("take")
    await holder.hears("control", state="yours")
    await holder.say(kind, fence=FENCE, seq=6, **fields)
    if code is None:
        await holder.hears("accepted", of=kind, seq=6)
    else:
        assert (await holder.hears("refused", of=kind, seq=6))["refusal"]["code"] == code
        assert not [message for message in bridge.heard if isinstance(message, wire.TaskRequest)]


async def test_allow_list_comes_from_the_admin(open_page, bridge, robot, monkeypatch):
    monkeypatch.undo()  # without this module's allow-list
    page = await open_page("operator")
    await page.say("take")
    await page.hears("control", state="yours")
    publish = {"fence": FENCE, "topic": "/notes", "type": "std_msgs/String"}
    await page.say("publish", **publish, seq=1)
    assert (await page.hears("refused", seq=1))["refusal"]["code"] == "not_allowed"
    allowance = {"what": "publish", "name": "/notes", "type": "std_msgs/String", "role": "operator"}
    await in_database(lambda: Allowance.objects.create(robot=robot, **allowance))
    await page.hears("welcome")  # the robot was edited
    await page.say("publish", **publish, seq=2)
    await page.hears("accepted", seq=2)


async def test_higher_role_may_choose_more_topics(open_page, bridge):
    page = await open_page("supervisor")
    await page.say("take")
    await page.hears("control", state="yours")
    await page.say("choose", fence=FENCE, use="drive", topic="/nav_vel", seq=1)
    await page.hears("accepted", of="choose", seq=1)


async def test_requests_reach_the_bridge_in_order(holder, bridge):
    for seq in range(1, 7):
        await holder.say("say", fence=FENCE, text=str(seq), language="en", seq=seq)
    for seq in range(1, 7):
        await holder.hears("accepted", of="say", seq=seq)
    assert [message.text for message in bridge.all(wire.Say)] == ["1", "2", "3", "4", "5", "6"]


@pytest.fixture
async def risen(open_page, supervisor):
    """The page of a person who took control as an operator and became a supervisor after that."""
    await set_role(supervisor, "operator")
    page = await open_page("supervisor")
    await page.say("take")
    await page.hears("control", state="yours")
    await set_role(supervisor, "supervisor")
    await page.hears("welcome", role="supervisor")
    return page


def set_role(person, role):
    return in_database(lambda: RobotRole.objects.filter(user=person).update(role=role))


async def test_raised_role_counts_from_the_next_take_on(risen, bridge):
    await risen.say("choose", fence=FENCE, use="drive", topic="/nav_vel", seq=1)
    refusal = (await risen.hears("refused", of="choose", seq=1))["refusal"]
    assert (refusal["code"], refusal["figures"]["taken_as"]) == ("role_of_control", "operator")
    assert not bridge.all(wire.Choose)
    await risen.say("release")
    await risen.hears("control", state="free")
    await risen.say("take")
    fence = (await risen.hears("control", state="yours"))["fence"]
    await risen.say("choose", fence=fence, use="drive", topic="/nav_vel", seq=2)
    await risen.hears("accepted", of="choose", seq=2)


# --- offers -----------------------------------------------------------------------------------------


async def test_page_learns_the_robots_offers_and_their_changes(open_page, bridge):
    bridge.offers = wire.Offers([wire.MotionOffer("wave", "Wave")], languages=["es", "ca"])
    page = await open_page("observer")
    offers = await page.hears("offers")
    assert (offers["motions"][0]["title"], offers["languages"]) == ("Wave", ["es", "ca"])
    bridge.say(wire.Offers(motions_text="No motions: play_motion does not run."))
    assert (await page.hears("offers"))["motions"] == []
    late = await open_page("operator")
    assert (await late.hears("offers"))["motions_text"].startswith("No motions")


async def test_viewer_refreshes_the_offers_at_a_limited_rate(open_page, bridge, monkeypatch):
    monkeypatch.setattr("teleop.live.robot_hub.REFRESH_S", 60.0)
    bridge.offers = wire.Offers([])
    page = await open_page("observer")
    await page.hears("offers")
    for seq in range(1, 6):
        await page.say("refresh", seq=seq)
        await page.hears("accepted", of="refresh", seq=seq)
    await page.say("ping", sent_ms=1)
    await page.hears("pong")
    await bridge.hears(wire.Refresh)
    assert len(bridge.all(wire.Refresh)) == 1
    bridge.say(wire.Offers(languages=["es"]))
    await page.hears("offers")
    await page.say("refresh", seq=6)  # too soon: the page gets the last offers
    assert (await page.hears("offers"))["languages"] == ["es"]


async def test_offers_are_not_refreshed_without_bridge(open_page, bridge):
    page = await open_page("observer")
    await bridge.close()
    await page.hears("bridge_gone")
    await page.say("refresh", seq=1)
    assert (await page.hears("refused", of="refresh", seq=1))["refusal"]["code"] == "bridge_down"
