"""Services through the door: rosapi, those of the allow-list, and those of other clients."""

from __future__ import annotations

import json

import pytest

from fleet.accounts.tokens.models import Scope
from fleet.audit.models import Record
from robots.shared import wire
from robots.shared.configuration.bridge_config import Allowed
from teleop.background.database import in_database
from teleop.rosbridge.clients import actions, post, services
from teleop.rosbridge.clients.letters import Goal, Offer
from teleop.rosbridge.clients.post import Post
from teleop.rosbridge.service_calls import MOST_PENDING

pytestmark = pytest.mark.django_db(transaction=True)

ADD, COUNT = "/fleet/clients/add", "/fleet/clients/count"
USES = (
    {"op": "call_service", "service": ADD},
    {"op": "send_action_goal", "action": COUNT, "id": "mine", "args": {}},
    {"op": "publish", "topic": f"{COUNT}/goal", "msg": {}},
)


@pytest.fixture(autouse=True)
def allowed(allow):
    """The content of the allow-list."""
    allow(
        Allowed("call", "/lamp", "std_srvs/SetBool", "", "staff"),
        Allowed("set", "/volume", "", "", "staff"),
        Allowed("call", ADD, "lab_srvs/Add", "", "operator"),
        Allowed("call", "/fleet/clients/count", "lab_msgs/CountAction", "", "operator"),
        Allowed("call", "/fleet/clients/other", "lab_msgs/CountAction", "", "operator"),
        Allowed("call", "/fleet/clients/boss", "lab_srvs/Add", "", "supervisor"),
    )


# --- the robot's --------------------------------------------------------------------------------------------


async def test_rosapi_answers_everybody_who_sees_the_robot(open_client, bridge):
    bridge.answer = lambda ask: wire.Graph([wire.TopicRow("/odom", "nav_msgs/Odometry")], [], [], ask.seq)
    client = await open_client("observer", scopes=(Scope.TOPICS,))
    answer = await client.call("/rosapi/topics")
    assert answer["values"] == {"topics": ["/odom"], "types": ["nav_msgs/Odometry"]}
    await client.send("call_service", service="rosapi/services", id="x")  # as roslibjs writes it
    names = (await client.hears_op("service_response", id="x"))["values"]["services"]
    assert {"/rosapi/topics", "/fleet/take_control"} <= set(names)


async def test_rosapi_needs_the_scope(open_client, bridge):
    client = await open_client("operator", scopes=(Scope.DRIVE,))
    assert (await client.call("/rosapi/topics"))["values"].startswith("scope_missing: ")


async def test_a_service_of_the_allow_list_is_called_by_staff_in_control(open_client, bridge):
    bridge.answer = lambda ask: wire.Called(ask.service, {"success": True}, ask.seq)
    client = await open_client("staff")
    assert (await client.call("/lamp", data=True))["values"].startswith("no_lease: ")
    await client.take()
    assert (await client.call("/lamp", data=True))["values"] == {"success": True}
    asked = await bridge.hears(wire.LinkQuery, lambda query: isinstance(query.ask, wire.CallService))
    assert (asked.ask.fields, asked.ask.whole) == ({"data": True}, True)
    assert await in_database(Record.objects.filter(kind="service.call", of=None).exists)


async def test_calls_that_never_return_shut_out_nobody_else(open_client, bridge, monkeypatch):
    answer = bridge._answer

    def answer_but_calls(link, message) -> None:
        if not (isinstance(message, wire.LinkQuery) and isinstance(message.ask, wire.CallService)):
            answer(link, message)

    monkeypatch.setattr(bridge, "_answer", answer_but_calls)
    bridge.answer = lambda ask: wire.Parameters(["/a"], ask.seq)
    client, other = await open_client("staff"), await open_client("operator")
    await client.take()
    for number in range(MOST_PENDING):
        await client.send("call_service", service="/lamp", args={"data": True}, id=f"call:{number}")
    busy = "busy: More than 8 queries at once"
    refused = [await client.hears_op("service_response") for _ in range(MOST_PENDING - 8)]
    assert all(one["values"].startswith(busy) for one in refused)
    assert (await other.call("/rosapi/get_param_names"))["values"] == {"names": ["/a"]}
    bridge.cut()
    for _ in range(8):
        await client.hears_op("service_response")


async def test_other_services_are_refused_with_a_reason(driver, bridge):
    assert (await driver.call("/lamp", data=True))["values"].startswith("role_too_low: ")
    answer = await driver.call("/reboot")
    assert not answer["result"]
    assert answer["values"].startswith("not_allowed: ")
    await driver.told("not_allowed")
    assert not bridge.all(wire.LinkQuery)


async def test_a_parameter_is_set_and_deleted_by_staff_in_control(open_client, driver, bridge):
    assert (await driver.call("/rosapi/set_param", name="/volume", value="5"))["values"].startswith(
        "role_too_low"
    )
    await driver.call("/fleet/release_control")
    bridge.answer = lambda ask: wire.Parameter(ask.name, 5, ask.seq)
    client = await open_client("staff")
    await client.take()
    assert (await client.call("/rosapi/set_param", name="/volume", value=json.dumps(5)))["result"]
    assert (await client.call("/rosapi/delete_param", name="/volume"))["result"]
    kinds = await in_database(lambda: set(Record.objects.values_list("kind", flat=True)))
    assert {"parameter.set", "parameter.delete"} <= kinds
    assert (await client.call("/rosapi/delete_param", name="/other"))["values"].startswith("not_allowed: ")


# --- of clients ------------------------------------------------------------------------------------------------


@pytest.fixture
async def server(open_client):
    """A client that offers the service /add."""
    client = await open_client("operator")
    await client.send("advertise_service", service="/add", type="lab_srvs/Add")
    return client


async def test_a_clients_service_answers_other_clients(server, open_client):
    other = await open_client("second_operator")
    await eventually_offered(other)
    await other.send("call_service", service=ADD, args={"a": 1, "b": 2}, id="call:1")
    asked = await server.hears_op("call_service", service="/add", args={"a": 1, "b": 2})
    await server.send("service_response", service="/add", id=asked["id"], values={"sum": 3}, result=True)
    answer = await other.hears_op("service_response", id="call:1")
    assert (answer["service"], answer["values"], answer["result"]) == (ADD, {"sum": 3}, True)
    await other.send("call_service", service=ADD, id="call:2")
    asked = await server.hears_op("call_service", service="/add")
    await server.send("service_response", service="/add", id=asked["id"], values="no", result=False)
    assert "service_failed: " in (await other.hears_op("service_response", id="call:2"))["values"]


async def test_names_of_the_robot_are_never_a_clients(server, open_client, bridge):
    rows = [wire.ServiceRow("/add", "/robot")], [wire.ActionRow("/count", "lab_msgs/CountAction")]
    bridge.answer = lambda ask: (
        wire.Graph([], rows[1], rows[0], ask.seq)
        if isinstance(ask, wire.ListTopics)
        else wire.ServiceTypes({"/add": "robot_srvs/Add"}, ask.seq)
    )
    other = await open_client("second_operator")
    await eventually_offered(other)
    await server.send("advertise_action", action="/count", type="lab_msgs/CountAction")
    await server.send("subscribe", topic="/count/goal")
    await server.send("subscribe", topic="/fleet/clients/count/goal")
    await server.call("/fleet/renew_control")  # its answer comes after the offer
    assert (await other.call("/add"))["values"].startswith("not_allowed: ")
    await other.send("send_action_goal", id="mine", action="/count", args={})
    assert (await other.hears_op("action_result", id="mine"))["values"].startswith("not_allowed: ")
    await other.send("publish", topic="/count/goal", msg={}, id="publish:1")
    assert (await other.hears_op("status", id="publish:1"))["msg"].startswith("not_allowed: /count/goal")
    assert (await other.call("/rosapi/service_type", service="/add"))["values"]["type"] == "robot_srvs/Add"
    assert {"/add", ADD} <= set((await other.call("/rosapi/services"))["values"]["services"])
    listed = (await other.call("/rosapi/action_servers"))["values"]["action_servers"]
    assert listed == ["/count", "/fleet/clients/count"]
    await other.send("publish", topic="/fleet/clients/count/goal", msg={})
    assert (await server.hears_op("publish"))["topic"] == "/fleet/clients/count/goal"
    assert not [one for one in server.inbox if one["op"] in ("call_service", "send_action_goal")]


async def eventually_offered(client) -> None:
    while (await client.call("/rosapi/service_type", service=ADD))["values"]["type"] != "lab_srvs/Add":
        pass


async def test_a_clients_service_is_gone_with_the_client(server, open_client, bridge):
    bridge.answer = lambda ask: wire.ServiceTypes({}, ask.seq)
    other = await open_client("second_operator")
    await eventually_offered(other)
    await other.send("call_service", service=ADD, id="call:1")
    await server.hears_op("call_service")
    await server.close()
    answer = await other.hears_op("service_response", id="call:1")
    assert answer["values"].startswith("client_left: ")
    assert (await other.call(ADD))["values"].startswith("no_service: ")
    assert (await other.call("/rosapi/service_type", service=ADD))["values"] == {"type": ""}


async def test_an_offer_that_ends_ends_its_calls_and_goals(server, open_client):
    other = await open_client("second_operator")
    await eventually_offered(other)
    await server.send("advertise_action", action="/count", type="lab_msgs/CountAction")
    await server.call("/fleet/renew_control")
    await other.send("call_service", service=ADD, id="call:1")
    await server.hears_op("call_service")
    await other.send("send_action_goal", id="mine", action="/fleet/clients/count", args={})
    await server.hears_op("send_action_goal")
    await server.send("unadvertise_service", service="/add")
    answer = await other.hears_op("service_response", id="call:1")
    assert answer["values"].startswith("client_left: ")
    await server.send("unadvertise_action", action="/count")
    result = await other.hears_op("action_result", id="mine")
    assert result["values"].startswith("client_left: ")


async def test_a_service_that_never_answers_is_given_up(server, open_client, monkeypatch):
    monkeypatch.setattr(services, "CALL_S", 0.1)
    other = await open_client("second_operator")
    await eventually_offered(other)
    assert (await other.call(ADD))["values"].startswith("service_silent: ")
    asked = await server.hears_op("call_service")
    await server.send("service_response", service="/add", id=asked["id"], values={}, result=True)
    await server.told("no_call")


async def test_a_call_ends_within_the_time_that_its_client_gives(server, open_client):
    other = await open_client("second_operator")
    await eventually_offered(other)
    await other.send("call_service", service=ADD, id="call:1", timeout=0.05)
    answer = await other.hears_op("service_response", id="call:1")
    assert answer["values"].startswith(f"service_silent: {ADD} did not answer within 0.05 s")
    asked = await server.hears_op("call_service")
    await server.send("service_response", service="/add", id=asked["id"], values={}, result=True)
    assert (await other.call("/fleet/release_control"))["values"].startswith("no_lease: ")
    assert not [one for one in other.inbox if one.get("id") == "call:1" and one["op"] != "status"]


@pytest.mark.parametrize(
    ("service", "type_", "code"),
    [
        ("/other", "lab_srvs/Add", "not_allowed"),
        ("/add", "lab_srvs/Other", "not_allowed"),
        ("/boss", "lab_srvs/Add", "role_too_low"),
    ],
)
async def test_only_services_of_the_allow_list_are_offered(service, type_, code, open_client, bridge):
    client = await open_client("operator")
    await client.send("advertise_service", service=service, type=type_)
    await client.told(code)


async def test_a_name_is_offered_once(server, open_client):
    other = await open_client("second_operator")
    await eventually_offered(other)
    await other.send("advertise_service", service="/add", type="lab_srvs/Add")
    await other.told("name_taken")
    await server.send("unadvertise_service", service="/add")
    await server.send("unadvertise_service", service="/add")
    await server.send("set_level", level="none")
    await server.call("/fleet/release_control")
    await other.send("advertise_service", service="/add", type="lab_srvs/Add")
    await eventually_offered(other)


@pytest.mark.parametrize("use", USES)
async def test_what_clients_offer_is_used_by_the_role_of_its_entry(use, server, open_client):
    await server.send("advertise_action", action="/count", type="lab_msgs/CountAction")
    await server.call("/fleet/renew_control")
    observer = await open_client("observer")
    await observer.send(**use)
    await observer.told("role_too_low")


@pytest.mark.parametrize(
    "use",
    [
        *USES,
        {"op": "advertise_service", "service": ADD, "type": "lab_srvs/Add"},
        {"op": "advertise_action", "action": COUNT, "type": "lab_msgs/CountAction"},
        {"op": "call_service", "service": "/lamp"},
        {"op": "call_service", "service": "/republish_tfs"},
        {"op": "subscribe", "topic": "/scan"},
    ],
)
async def test_a_token_for_driving_only_uses_and_offers_nothing(use, server, open_client):
    await server.send("advertise_action", action="/count", type="lab_msgs/CountAction")
    await server.call("/fleet/renew_control")
    client = await open_client("staff", scopes=(Scope.DRIVE,))
    await client.send(**use)
    await client.told("scope_missing")


# --- actions of clients ----------------------------------------------------------------------------------------------


async def test_a_clients_action_takes_goals_of_other_clients(open_client, bridge):
    server, other = await open_client("operator"), await open_client("second_operator")
    await server.send("advertise_action", action="/count", type="lab_msgs/CountAction")
    await server.call("/fleet/renew_control")  # its answer comes after the offer
    goal = {"action": "/fleet/clients/count", "action_type": "lab_msgs/CountAction", "feedback": True}
    await other.send("send_action_goal", id="mine", args={"to": 3}, **goal)
    taken = await server.hears_op("send_action_goal", action="/count", args={"to": 3})
    await server.send("action_feedback", id=taken["id"], action="/count", values={"at": 1})
    assert (await other.hears_op("action_feedback", id="mine"))["values"] == {"at": 1}
    await other.send("send_action_goal", id="mine", args={"to": 4}, **goal)
    assert (await other.told("goal_twice"))["id"] == "mine"
    await other.send("cancel_action_goal", id="mine", action="/fleet/clients/count")
    await server.hears_op("cancel_action_goal", id=taken["id"])
    assert (await other.call("/fleet/clients/count/_action/cancel_goal"))[
        "result"
    ]  # cancelAllGoals of roslibjs
    await server.hears_op("cancel_action_goal", id=taken["id"])
    assert not [one for one in server.inbox if one["op"] == "send_action_goal"]
    await server.send(
        "action_result", id=taken["id"], action="/count", values={"at": 2}, status=5, result=True
    )
    result = await other.hears_op("action_result", id="mine")
    assert (result["values"], result["status"], result["result"]) == ({"at": 2}, 5, True)
    await server.send("action_result", id=taken["id"], action="/count", values={}, result=True)
    await server.told("no_goal")


async def test_the_goals_that_one_client_sends_to_others_are_limited(open_client, bridge, monkeypatch):
    monkeypatch.setattr(actions, "MOST_GOALS", 1)
    for name in ("count", "other"):
        server = await open_client("operator")
        await server.send("advertise_action", action=name, type="lab_msgs/CountAction")
        await server.call("/fleet/renew_control")
    asker, more = await open_client("second_operator"), await open_client("second_operator")
    await asker.send("send_action_goal", id="1", action="/fleet/clients/count", args={})
    await asker.send("send_action_goal", id="2", action="/fleet/clients/other", args={})
    assert (await asker.hears_op("action_result", id="2"))["values"].startswith("busy: ")
    await more.send("send_action_goal", id="1", action="/fleet/clients/other", args={})
    await server.hears_op("send_action_goal")


async def test_a_goal_ends_when_the_client_that_took_it_leaves(open_client, bridge):
    server, other = await open_client("operator"), await open_client("second_operator")
    await server.send("advertise_action", action="/count", type="lab_msgs/CountAction")
    await server.call("/fleet/renew_control")
    await other.send("send_action_goal", id="mine", action="/fleet/clients/count", args={})
    await server.hears_op("send_action_goal")
    await server.close()
    result = await other.hears_op("action_result", id="mine")
    assert (result["result"], result["status"]) == (False, 6)
    assert result["values"].startswith("client_left: ")
    await other.send("send_action_goal", id="again", action="/fleet/clients/count", args={})
    assert (await other.hears_op("action_result", id="again"))["values"].startswith("not_allowed: ")


async def test_goals_end_with_the_web_process_of_their_other_end(robot, open_client, bridge, monkeypatch):
    monkeypatch.setattr(post, "TELL_S", 0.05)
    client = await open_client("operator")
    await client.send("advertise_action", action="/other", type="lab_msgs/CountAction")
    await client.call("/fleet/renew_control")  # its answer comes after the offer
    elsewhere = Post(robot.id)
    address = elsewhere.join("ann", {})
    elsewhere.offer(Offer("action", COUNT, "lab_msgs/CountAction", "ann"))
    [here] = [one for one in post._posts.values() if one._clients]
    while not (found := elsewhere.find("action", "/fleet/clients/other")) or not here.find("action", COUNT):
        await client.call("/fleet/renew_control")
    await elsewhere.send(address, found[1], Goal("theirs", "/fleet/clients/other", {}, feedback=False))
    taken = await client.hears_op("send_action_goal", action="/other")
    await client.send("send_action_goal", id="mine", action=COUNT, args={})
    monkeypatch.setattr(post, "GONE_S", 0.2)
    for task in elsewhere._tasks:  # as when it is killed
        task.cancel()
    result = await client.hears_op("action_result", id="mine")
    assert result["values"].startswith("client_left: ")
    await client.hears_op("cancel_action_goal", id=taken["id"])


async def test_a_client_that_leaves_cancels_the_goals_that_it_sent(open_client, bridge):
    server, other = await open_client("operator"), await open_client("second_operator")
    await server.send("advertise_action", action="/count", type="lab_msgs/CountAction")
    await server.call("/fleet/renew_control")
    await other.send("send_action_goal", id="mine", action="/fleet/clients/count", args={})
    taken = await server.hears_op("send_action_goal")
    await other.close()
    await server.hears_op("cancel_action_goal", id=taken["id"])


async def test_a_clients_action_by_topics_reaches_other_clients_only(open_client, bridge):
    server, other = await open_client("operator"), await open_client("second_operator")
    await server.send("subscribe", topic="/fleet/clients/count/goal")
    await other.send("subscribe", topic="/fleet/clients/count/status")
    await other.call("/fleet/renew_control")  # its answer comes after the subscription
    await server.send("advertise", topic="/fleet/clients/count/status", type="actionlib_msgs/GoalStatusArray")
    await server.send("publish", topic="/fleet/clients/count/status", msg={"status_list": []})
    heard = await other.hears_op("publish", topic="/fleet/clients/count/status")
    assert heard["msg"] == {"status_list": []}
    await other.send("publish", topic="/fleet/clients/count/goal", msg={"goal": {"to": 3}})
    assert (await server.hears_op("publish", topic="/fleet/clients/count/goal"))["msg"]["goal"] == {"to": 3}
    await server.send("subscribe", topic="/fleet/clients/count/cancel")
    await server.call("/fleet/renew_control")
    await other.send("publish", topic="/fleet/clients/count/cancel", msg={"id": "mine"})
    cancel = await server.hears_op("publish", topic="/fleet/clients/count/cancel")
    assert cancel["msg"] == {"id": "mine", "stamp": {"secs": 0, "nsecs": 0}}
    await other.send("publish", topic="/fleet/clients/count/result", msg={})
    await other.told("name_taken")
    assert not bridge.all(wire.Publish)
    await server.close()
    await other.send("publish", topic="/fleet/clients/count/result", msg={}, id="again")
    await other.send("publish", topic="/other/result", msg={})
    assert "/other/result" in (await other.told("not_allowed"))["msg"]
