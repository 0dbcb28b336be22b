"""Cameras of a whole console: a lost process, a viewer who stops reading, a damaged camera, a lost right."""

from __future__ import annotations

import asyncio
import os
import signal

from benchmarks.parts.observer import Observer
from script.stack.client import Driver, sign_in
from script.stack.processes import Child
from script.stack.stack import PRACTICE_ROBOTS, Stack
from tests.processes import PATIENCE_S
from tests.script.support import Family
from tests.script.viewer import viewer

ROBOT = PRACTICE_ROBOTS[0]
ENDS_S = 1.0  # from the loss of a right to the last picture
SLACK_S = 1.0  # for a busy computer


def camera_process(stack: Stack) -> int:
    return Family(stack.supervisor.pid).named("robots.bridge.ros.camera")


async def test_control_goes_on_while_a_camera_process_is_lost(stack):
    cookie = await asyncio.to_thread(sign_in, stack, "operator")
    async with viewer(stack, cookie) as watching, Driver(stack, ROBOT.slug, cookie) as driver:
        await watching.watch("head", "rear")
        await watching.gets_pictures("head")
        await watching.gets_pictures("rear")
        await driver.take()
        await driver.until(lambda: driver.state and all(sensor.ok for sensor in driver.state.sensors))
        for number in (signal.SIGKILL, signal.SIGSTOP):
            first = camera_process(stack)
            os.kill(first, number)
            driving = asyncio.create_task(
                driver.hold_stick(0.0, 0.5, until=lambda: (watching.refusals.get("head") or {}).get("text"))
            )
            await watching.until(lambda: (watching.refusals.get("head") or {}).get("text"))
            await driving
            assert driver.fence is not None, "control goes on"
            await watching.gets_pictures("head")
            assert watching.refusals["head"] is None
            assert camera_process(stack) != first
        await driver.release()


async def test_a_damaged_camera_is_named_and_the_other_goes_on(stack):
    cookie = await asyncio.to_thread(sign_in, stack, "observer")
    async with Observer(stack.robots[ROBOT.slug]) as robot, viewer(stack, cookie) as watching:
        await watching.watch("head", "rear")
        await watching.gets_pictures("head")
        for fault, words in (
            ("camera_truncated", "is cut off"),
            ("camera_huge", "20000 x 20000"),
            ("camera_bomb", "20000 x 20000"),
            ("camera_zero", "neither JPEG nor PNG"),
            ("camera_dead", "has sent no picture"),
        ):
            await robot.cause(fault)
            await watching.until(
                lambda words=words: words in (watching.refusals.get("head") or {}).get("text", "")
            )
            await watching.gets_pictures("rear")
            await robot.cause("none")
            await watching.gets_pictures("head")


async def test_a_camera_that_changes_encoding_or_rate_goes_on(stack):
    cookie = await asyncio.to_thread(sign_in, stack, "observer")
    async with Observer(stack.robots[ROBOT.slug]) as robot, viewer(stack, cookie) as watching:
        await watching.watch("head")
        await watching.gets_pictures("head")
        await robot.cause("camera_encoding_changes")
        await watching.until(lambda: {"jpeg", "png"} <= {picture["format"] for picture in watching.pictures})
        await robot.cause("camera_rate_hz=1")
        await watching.gets_pictures("head")
        await robot.cause("none")
        await watching.gets_pictures("head")
        assert not watching.refusals.get("head")


async def test_words_say_why_no_way_is_drawn_into_pictures_that_come(stack):
    cookie = await asyncio.to_thread(sign_in, stack, "observer")
    async with Observer(stack.robots[ROBOT.slug]) as robot, viewer(stack, cookie) as watching:
        await watching.watch("head")
        await watching.gets_pictures("head")
        await robot.cause("camera_info_wrong")
        await watching.until(lambda: "lens" in (watching.warnings["head"] or {}).get("text", ""))
        await watching.gets_pictures("head")
        await robot.cause("none")
        await watching.until(lambda: watching.warnings["head"] is None)


async def test_a_viewer_who_never_acknowledges_slows_no_other(stack):
    cookie = await asyncio.to_thread(sign_in, stack, "observer")
    async with viewer(stack, cookie, stalls=True) as stalled, viewer(stack, cookie) as watching:
        await stalled.watch("rear")
        await watching.watch("rear")
        await stalled.gets_pictures("rear", 2)
        await watching.gets_pictures("rear", 20)
        assert len(stalled.pictures) <= 4, "two of full size, then two smaller ones"


async def test_pictures_end_within_a_second_of_the_right(stack):
    def set_role(role: str) -> Child:
        code = (
            "from fleet.accounts.models import User; from robots.registry.models import Robot, Role;"
            "from robots.access.services import role_set; from fleet.audit.command_line import here;"
            f"role_set(robot=Robot.objects.get(slug='{ROBOT.slug}'),"
            f" user=User.objects.get(username='observer'), role={role}, actor=here());"
            "import time; print('at', time.monotonic())"
        )
        return stack.manage("role", "shell", "--no-imports", "-c", code)

    cookie = await asyncio.to_thread(sign_in, stack, "observer")
    async with viewer(stack, cookie) as watching:
        await watching.watch("head")
        await watching.gets_pictures()
        command = set_role("None")
        await watching.until(lambda: watching.closed_s is not None)
        assert await asyncio.to_thread(command.wait, PATIENCE_S)
    revoked_s = float(command.last_lines().split("at ")[-1])
    assert watching.closed_s - revoked_s < ENDS_S + SLACK_S
    given_back = set_role("Role.OBSERVER")
    assert await asyncio.to_thread(given_back.wait, PATIENCE_S)
    assert given_back.process.returncode == 0
