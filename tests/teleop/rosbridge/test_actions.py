"""Goals through the door: tasks of the chain, with the client's own ids."""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress

import pytest
from msgspec import structs

from fleet.accounts.tokens.models import Scope
from fleet.audit.models import Record
from robots.shared import wire
from teleop.background import jobs
from teleop.background.database import in_database
from teleop.models import ControlSession
from teleop.rosbridge.actions import goals, reports
from teleop.tap import feed
from tests.teleop.rosbridge.support import Client
from tests.teleop.support import IDLE, eventually
from tests.teleop.tap.support import FakeTap

pytestmark = pytest.mark.django_db(transaction=True)

PLAY = {"action": "/play_motion", "action_type": "play_motion_msgs/PlayMotionAction", "feedback": True}
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6  # in ROS 2


@pytest.fixture(autouse=True)
def no_tap(monkeypatch) -> None:
    """Do not wait for the robot's own reports: there is no robot."""
    monkeypatch.setattr(reports, "READY_S", 0.01)
    monkeypatch.setattr(goals, "RESULT_S", 0.01)


def ended(bridge, number: int, outcome: str) -> None:
    end = wire.MotionEnd(number, "wave", outcome, "" if outcome == "succeeded" else "Reason.")
    bridge.say(wire.Status(structs.replace(IDLE, motion_ended=end)))


async def sends(client, id_: str, motion: str = "wave") -> None:
    await client.send("send_action_goal", id=id_, args={"motion_name": motion}, **PLAY)


async def test_a_goal_is_a_task_and_its_end_the_result(driver, bridge):
    await sends(driver, "send_action_goal:/play_motion:1")
    played = await bridge.hears(wire.Play)
    assert (played.motion, played.fence) == ("wave", 1)
    ended(bridge, 1, "succeeded")
    result = await driver.hears_op("action_result", id="send_action_goal:/play_motion:1")
    assert (result["result"], result["status"], result["action"]) == (True, SUCCEEDED, "/play_motion")


def said(id_: str, **fields) -> dict:
    return {
        "header": {},
        "status": {"goal_id": {"stamp": {"secs": 0, "nsecs": 0}, "id": id_}, "status": 1},
        **fields,
    }


async def test_the_robots_feedback_and_result_come_under_the_clients_id(driver, bridge, robot, monkeypatch):
    monkeypatch.setattr(reports, "READY_S", 10.0)
    monkeypatch.setattr(goals, "RESULT_S", 10.0)
    tap = FakeTap(robot)
    topics = ["/play_motion/feedback", "/play_motion/result"]
    try:
        await sends(driver, "mine")
        await tap.start(bridge)
        await tap.until(lambda wanted: all(topic in wanted for topic in topics))
        assert not bridge.all(wire.Play), "the goal waits until nothing that the robot says is missed"
        for topic in topics:
            tap.describe(topic)
        await bridge.hears(wire.Play)
        await driver.call("/fleet/renew_control")  # answered after the bridge accepted the goal
        tap.publish(topics[0], said("another node's", feedback={"at": 1}))
        tap.publish(topics[0], said(f"{wire.GOAL_PREFIX}7-x", feedback={"at": 2}))
        assert (await driver.hears_op("action_feedback", id="mine"))["values"] == {"at": 2}
        ended(bridge, 1, "succeeded")
        tap.publish(topics[1], said(f"{wire.GOAL_PREFIX}7-x", result={"error_code": 1}))
        assert (await driver.hears_op("action_result", id="mine"))["values"] == {"error_code": 1}
    finally:
        await tap.close()


async def test_an_end_before_the_request_is_not_the_goals(driver, bridge, robot, monkeypatch):
    monkeypatch.setattr(reports, "READY_S", 10.0)
    tap = FakeTap(robot)
    try:
        await sends(driver, "mine")
        await tap.start(bridge)
        await tap.until(lambda wanted: "/play_motion/result" in wanted)
        ended(bridge, 1, "failed")
        await driver.call("/fleet/renew_control")
        for part in ("feedback", "result"):
            tap.describe(f"/play_motion/{part}")
        await bridge.hears(wire.Play)
        ended(bridge, 2, "succeeded")
        assert (await driver.hears_op("action_result", id="mine"))["status"] == SUCCEEDED
    finally:
        await tap.close()


async def test_an_older_end_is_not_the_goals(driver, bridge):
    ended(bridge, 1, "succeeded")
    await bridge.hears(wire.LinkVelocity)  # the state is known before the goal comes
    await sends(driver, "a")
    await bridge.hears(wire.Play)
    ended(bridge, 2, "failed")
    result = await driver.hears_op("action_result")
    assert (result["result"], result["status"], result["values"]) == (False, ABORTED, "Reason.")


async def test_two_goals_end_in_their_order(driver, bridge):
    await sends(driver, "first")
    await sends(driver, "second", "nod")
    await bridge.hears(wire.Play, count=2)
    ended(bridge, 1, "succeeded")
    assert (await driver.hears_op("action_result"))["id"] == "first"
    ended(bridge, 2, "succeeded")
    assert (await driver.hears_op("action_result"))["id"] == "second"


async def test_a_cancel_ends_only_the_clients_own_goal(driver, open_client, bridge):
    await sends(driver, "mine")
    await bridge.hears(wire.Play)
    other = await open_client("second_operator")
    await other.send("cancel_action_goal", id="mine", action="/play_motion")
    await other.told("no_goal")
    assert not bridge.all(wire.PlayCancel)
    await driver.send("cancel_action_goal", id="mine", action="/play_motion")
    await bridge.hears(wire.PlayCancel)
    ended(bridge, 1, "cancelled")
    result = await driver.hears_op("action_result")
    assert (result["result"], result["status"]) == (True, CANCELED)


async def test_all_goals_of_a_client_are_cancelled_by_a_service(driver, bridge):
    await sends(driver, "mine")
    await bridge.hears(wire.Play)
    assert (await driver.call("/play_motion/_action/cancel_goal"))["result"]
    await bridge.hears(wire.PlayCancel)


async def test_a_goal_without_control_is_refused_told_and_recorded(open_client, bridge):
    client = await open_client("operator")
    await sends(client, "mine")
    result = await client.hears_op("action_result", id="mine")
    assert not result["result"]
    assert result["values"].startswith("no_lease: ")
    assert (await client.told("no_lease"))["id"] == "mine"
    refused = await eventually(Record.objects.filter(kind="refusal").first)
    assert (refused.outcome, refused.parameters["through"]) == ("no_lease", "rosbridge")


@pytest.mark.parametrize(
    ("goal", "code"),
    [
        ({"action": "/play_motion", "args": {"motion_name": ""}}, "invalid"),
        ({"action": "/play_motion", "args": [1, 2]}, "invalid"),
        ({"action": "/arm_controller/follow_joint_trajectory"}, "not_allowed"),
    ],
)
async def test_a_goal_that_is_no_task_is_refused(goal, code, driver, bridge):
    await driver.send("send_action_goal", id="mine", **goal)
    assert (await driver.hears_op("action_result", id="mine"))["values"].startswith(f"{code}: ")
    await driver.told(code)


async def test_the_bridges_refusal_is_the_result(driver, bridge):
    bridge.refuses_tasks = wire.Refusal("unknown_motion", "No such motion.", "robot")
    await sends(driver, "mine")
    result = await driver.hears_op("action_result", id="mine")
    assert result["values"] == "unknown_motion: No such motion."


async def test_a_goal_needs_its_scope(open_client, bridge):
    client = await open_client("operator", scopes=(Scope.DRIVE,))
    await client.take()
    await sends(client, "mine")
    assert (await client.hears_op("action_result"))["values"].startswith("scope_missing: ")


async def test_a_goal_that_comes_twice_is_done_once(driver, bridge):
    await sends(driver, "mine")
    await bridge.hears(wire.Play)
    await sends(driver, "mine")
    await driver.told("goal_twice")
    assert len(bridge.all(wire.Play)) == 1
    ended(bridge, 1, "succeeded")
    assert (await driver.hears_op("action_result"))["result"]
    assert not [one for one in driver.inbox if one["op"] == "action_result"]


@pytest.mark.parametrize(
    "last",
    [
        {"op": "send_action_goal", "id": "mine", "args": {"motion_name": "wave"}, **PLAY},
        {"op": "call_service", "service": "/republish_tfs", "args": {"source_frames": ["a"]}},
        {"op": "call_service", "service": "/fleet/take_control"},
    ],
)
async def test_nothing_begins_for_a_client_that_left(last, open_client, bridge):
    client = await open_client("operator")
    await client.call("/fleet/renew_control")
    left = client.close()
    client._socket.input_queue.put_nowait({"type": "websocket.receive", "text": json.dumps(last)})
    await left
    await asyncio.gather(*jobs._running)
    assert not feed._feeds
    assert not await in_database(ControlSession.objects.exists)


async def test_what_waits_for_the_link_ends_with_its_client(robot, make_token, bridge, monkeypatch):
    left = asyncio.Event()

    async def finds_it_as_the_client_leaves(_hub):
        with suppress(asyncio.CancelledError):  # as `wait_for` before Python 3.12
            await left.wait()

    monkeypatch.setattr("teleop.live.robot_hub.RobotHub.wait_for_link", finds_it_as_the_client_leaves)
    client = await Client(robot.slug, token=await make_token("operator")).open()
    await client.send("subscribe", topic="/a")
    await client.call("/fleet/stop")  # it does not wait
    await client.close()
    await asyncio.gather(*jobs._running)
    assert not feed._feeds


async def test_goals_end_with_the_link(driver, bridge):
    await sends(driver, "mine")
    await bridge.hears(wire.Play)
    bridge.cut()
    assert (await driver.hears_op("action_result", id="mine"))["values"].startswith("link_lost: ")


async def test_a_goal_on_the_topic_is_a_task_and_an_empty_cancel_ends_it(driver, open_client, bridge):
    await driver.send("advertise", topic="/play_motion/goal", type="play_motion_msgs/PlayMotionActionGoal")
    goal = {"goal_id": {"stamp": {"secs": 0, "nsecs": 0}, "id": "goal_1"}, "goal": {"motion_name": "wave"}}
    await driver.send("publish", topic="/play_motion/goal", msg=goal)
    await bridge.hears(wire.Play)
    other = await open_client("second_operator")
    await other.send("publish", topic="/play_motion/cancel", msg={})
    await other.send("publish", topic="/play_motion/cancel", msg={"id": "goal_1"})
    await other.told("no_goal")
    assert not bridge.all(wire.PlayCancel)
    await driver.send("publish", topic="/play_motion/cancel", msg={"id": ""})
    await bridge.hears(wire.PlayCancel)


async def test_a_goal_on_the_topic_gets_status_and_result_with_its_id(driver, bridge):
    for part in ("status", "result"):
        await driver.send("subscribe", topic=f"/play_motion/{part}")
    first = await driver.hears_op("publish", topic="/play_motion/status")
    assert first["msg"]["status_list"] == []  # clients wait for it, and a robot with ROS 2 sends none
    goal = {"goal_id": {"id": "goal_1"}, "goal": {"motion_name": "wave"}}
    await driver.send("publish", topic="/play_motion/goal", msg=goal)
    active = await driver.hears_op("publish", topic="/play_motion/status")
    await bridge.hears(wire.Play)
    await driver.send("subscribe", topic="/play_motion/status", id="another")
    again = await driver.hears_op("publish", topic="/play_motion/status")
    # One that is missing counts as lost
    assert again["msg"]["status_list"] == active["msg"]["status_list"]
    ended(bridge, 1, "failed")
    last = await driver.hears_op("publish", topic="/play_motion/status")
    result = await driver.hears_op("publish", topic="/play_motion/result")
    (one,), (other,) = active["msg"]["status_list"], last["msg"]["status_list"]
    assert (one["goal_id"]["id"], one["status"], other["status"], other["text"]) == (
        "goal_1",
        1,
        4,
        "Reason.",
    )
    assert result["msg"]["status"] == other


async def test_a_goal_on_the_topic_is_refused_with_its_id(open_client, bridge):
    client = await open_client("operator")
    goal = {"goal_id": {"id": "goal_1"}, "goal": {"motion_name": "wave"}}
    await client.send("subscribe", topic="/fleet/status")
    await client.send("publish", topic="/play_motion/goal", msg=goal, id="publish:1")
    assert (await client.told("no_lease"))["id"] == "publish:1"
    heard = await client.hears_op("publish", topic="/fleet/status")
    assert (heard["msg"]["id"], heard["msg"]["level"]) == ("publish:1", "error")
    await client.send("publish", topic="/play_motion/goal", msg={"goal": {}}, id="publish:2")
    assert (await client.told("invalid"))["id"] == "publish:2"
