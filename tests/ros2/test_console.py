"""A console with a robot of ROS 2: what `script/demo --mixed --smoke` does, and its pictures."""

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest

from benchmarks.parts.observer import Observer
from script.stack.client import Driver, sign_in
from script.stack.smoke import drive_and_stop
from script.stack.stack import MIXED_ROBOTS, Stack, temporary_stack
from tests.ros2.side import needs_rclpy
from tests.script.programs.rosbridge_client import RosbridgeClient
from tests.script.support import token
from tests.script.viewer import viewer

pytestmark = needs_rclpy
ABORTED = 6
TRIES = 5
ROBOT = next(robot for robot in MIXED_ROBOTS if robot.ros == 2)


@pytest.fixture(scope="module")
def stack() -> Iterator[Stack]:
    with temporary_stack([ROBOT]) as stack:
        yield stack


@pytest.fixture(autouse=True)
def no_stop(stack: Stack) -> None:
    """Release the stop of the test before."""
    asyncio.run(release_stop(stack))


async def release_stop(stack: Stack) -> None:
    async with Driver(stack, ROBOT.slug, sign_in(stack, "operator")) as driver:
        await driver.until(lambda: driver.state)
        if driver.state and driver.state.stop.state != "clear":
            await driver.take()
            await driver.clear()


def test_a_person_drives_it_a_metre_and_stops_it(stack: Stack) -> None:
    assert "stop pressed" in asyncio.run(drive_and_stop(stack, ROBOT.slug))


@pytest.mark.last  # it turns the robot to a wall
async def test_it_stops_when_its_laser_dies(stack: Stack) -> None:
    slug = ROBOT.slug
    async with (
        Observer(stack.robots[slug]) as seen,
        Driver(stack, slug, sign_in(stack, "operator")) as driver,
    ):
        await driver.until(lambda: driver.state)
        await driver.take()
        await driver.hold_stick(0.0, 0.5, until=lambda: any(command.w for command in seen.commands))
        await seen.cause("laser_dead")
        seen.forget()
        await driver.hold_stick(0.0, 0.5, until=lambda: any(command.still for command in seen.commands))
        await seen.cause("none")


async def test_a_program_sends_goals_in_both_styles(stack: Stack) -> None:
    scopes = ("drive", "motions", "speak", "topics")
    async with RosbridgeClient(stack, ROBOT.slug, token(stack, "operator", *scopes, name="goals")) as client:

        def heard(**fields: object) -> list[dict[str, Any]]:
            return [message for message in client.messages if fields.items() <= message.items()]

        async def send(motion: str, id: str) -> None:
            kinds = {"action": "/play_motion2", "action_type": "play_motion2_msgs/action/PlayMotion2"}
            goal = {"op": "send_action_goal", **kinds, "id": id, "args": {"motion_name": motion}}
            await client.send(goal)

        async def performed(motion: str) -> dict[str, Any]:
            """Return the result. On a busy computer points and scans are late, which ends a motion: ask again."""
            for attempt in range(TRIES):
                id = f"{motion} {attempt}"
                await send(motion, id)
                await client.until(lambda id=id: heard(op="action_result", id=id))
                [result] = heard(op="action_result", id=id)
                if result["status"] != ABORTED:
                    break
            return result

        await client.call("/fleet/take_control")
        result = await performed("open")
        assert (result["status"], result["values"]) == (4, {"success": True, "error": ""})
        await send("wave", "waves")
        await client.send({"op": "cancel_action_goal", "action": "/play_motion2", "id": "waves"})
        await client.until(lambda: heard(op="action_result", id="waves", status=5))
        result = await performed("home")  # the next test may drive, and an arm elsewhere would slow it
        assert result["status"] == 4, result
        for part in ("feedback", "result"):
            await client.send({"op": "subscribe", "topic": f"/tts_engine/tts/{part}"})
        said = {"goal_id": {"id": "hello"}, "goal": {"input": "hello lab", "locale": "en_GB"}}
        await client.send({"op": "publish", "topic": "/tts_engine/tts/goal", "msg": said})
        await client.until(lambda: heard(op="publish", topic="/tts_engine/tts/result"))
        words = [message["msg"]["feedback"]["word"] for message in heard(topic="/tts_engine/tts/feedback")]
        [end] = [message["msg"] for message in heard(topic="/tts_engine/tts/result")]
        assert words == ["hello", "lab"]
        assert (end["status"]["goal_id"]["id"], end["status"]["status"]) == ("hello", 3), end


async def test_its_camera_is_shown_with_lens_and_place(stack: Stack) -> None:
    async with viewer(stack, sign_in(stack, "operator"), robot=ROBOT.slug) as page:
        await page.watch("head")
        await page.gets_pictures("head", 5)
        await page.until(lambda: page.pictures[-1].get("pose"))  # tf has come: the way can be drawn
        assert page.pictures[-1]["lens"] and page.warnings.get("head") is None
