"""A program sends a robot to a place through the whole console: REST, web process, bridge, navigation, robot."""

from __future__ import annotations

import math
import urllib.request
from pathlib import Path

import pytest

from robots.shared import wire
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack
from tests.browser.people import putting_back
from tests.script.programs.test_programs import ROBOT, Api
from tests.script.support import token

START = (2.0, 1.8, 0.0)  # m, degrees: free, as the metre before it


@pytest.fixture(autouse=True)
def _at_start(stack: Stack, tmp_path: Path) -> None:
    """The robot does not stand where another test left it, perhaps before a wall."""
    with putting_back(stack.robots[ROBOT], tmp_path) as put_back:
        put_back(START)


def test_a_program_sends_a_robot_to_a_place_and_back(stack: Stack) -> None:
    api = Api(stack, token(stack, "operator", "read", "drive"))
    robot = f"/robots/{ROBOT}"
    [known] = api("GET", "/maps")[1]["maps"]  # the demo's map
    assert api("POST", f"{robot}/control", {})[0] == 200
    assert api("POST", f"{robot}/forget", {})[0] in (
        200,
        202,
        204,
    )  # what it saw before it was carried is elsewhere
    here = api("GET", robot)[1]["state"]["location"]
    place = {"x": 3.0, "y": 1.8, "heading": 0.0}

    status, refused = api("POST", f"{robot}/go", {"x": 500.0, "y": 0.0})
    if status == 202:  # the map had not come yet: the task reports the refusal
        refused = {"code": _end(api, refused["number"])["outcome"]}
    assert refused["code"] == "goal_outside"
    assert api("POST", f"{robot}/go", {"x": "here", "y": 0.0})[1]["code"] == "invalid"

    status, task = api("POST", f"{robot}/go", place)
    assert status == 202, task
    arrived(_end(api, task["number"]))
    there = api("GET", robot)[1]["state"]["location"]
    assert math.dist((there["x"], there["y"]), (place["x"], place["y"])) < 0.25

    status, task = api("POST", f"{robot}/go", {"place": "Kitchen"})
    assert status == 202, task
    arrived(_end(api, task["number"]))
    there = api("GET", robot)[1]["state"]["location"]
    [kitchen] = [one for one in known["places"] if one["name"] == "kitchen"]
    assert math.dist((there["x"], there["y"]), (kitchen["x"], kitchen["y"])) < 0.25
    unknown = api("POST", f"{robot}/go", {"place": "cellar"})
    assert (unknown[0], unknown[1]["code"]) == (409, "place_unknown")
    assert api("GET", "/maps")[1]["maps"] == [known]  # the robot's own map is the same as the demo's map

    status, task = api("POST", f"{robot}/go", {"x": here["x"], "y": here["y"], "heading": 0.0})
    assert status == 202, task
    assert api("DELETE", f"{robot}/go")[0] == 204
    assert _end(api, task["number"])["outcome"] == "cancelled"
    assert api("DELETE", f"{robot}/go")[1]["code"] == "no_goal"

    status, found = api("GET", f"{robot}/map")
    assert status == 200 and found["width"] > 100
    request = urllib.request.Request(  # noqa: S310
        stack.url + found["picture"], headers={"Authorization": f"Bearer {api.token}"}
    )
    with urllib.request.urlopen(request, timeout=10.0) as answer:  # noqa: S310
        assert answer.headers["Content-Type"] == "image/png"
        assert answer.read(8) == b"\x89PNG\r\n\x1a\n"
    assert api("DELETE", f"{robot}/control")[0] in (200, 204)


def arrived(entry: dict[str, str]) -> None:
    """Check the end of a drive; the entry says why it ended otherwise."""
    assert entry["outcome"] == "arrived", entry


def _end(api: Api, number: int) -> dict[str, str]:
    """Wait for the end of a task."""
    for _ in range(4):
        entry: dict[str, str] = api("GET", f"/robots/{ROBOT}/tasks/{number}?wait=15")[1]
        if entry["outcome"] is not None:
            return entry
    raise AssertionError(entry)


async def test_a_page_sees_the_way_and_takes_over_by_its_stick(stack: Stack) -> None:
    async with Driver(stack, ROBOT, sign_in(stack, "operator")) as driver:
        await driver.take()
        await driver.until(
            lambda: driver.state and driver.state.location and not driver.state.location.problem
        )
        here = driver.state.location
        answer = await driver.request_task(wire.Go(driver.fence or 1, 0.0, 0.0, 0.0, place="cellar"))
        assert isinstance(answer, wire.Refused) and answer.refusal.code == "place_unknown"
        answer = await driver.request_task(wire.Go(driver.fence or 1, 0.0, 0.0, 0.0, place="Charging Dock"))
        assert isinstance(answer, wire.Accepted), answer
        await driver.until(lambda: driver.state.going)
        assert driver.state.going.place == "charging dock" and driver.state.going.x > 8.0
        assert isinstance(await driver.request_task(wire.GoCancel(driver.fence or 1)), wire.Accepted)
        await driver.until(lambda: not driver.state.going)
        answer = await driver.request_task(wire.Go(driver.fence or 1, here.x + 3.0, 2.1, 0.0))
        assert isinstance(answer, wire.Accepted), answer
        await driver.until(lambda: driver.path.path_cm)
        await driver.until(lambda: driver.state.going and driver.odometry.vx > 0.1)
        await driver.hold_stick(
            -0.2,
            0.0,
            until=lambda: driver.state.going_ended and driver.state.going_ended.outcome == "replaced",
        )
        await driver.until(lambda: not driver.path.path_cm)


SLOT_ENDS = """
from datetime import timedelta
from django.utils import timezone
from fleet.accounts.models import User
from fleet.bookings.models import Booking
from robots.registry.models import Robot
now = timezone.now()
ends, hour = now + timedelta(seconds=2), timedelta(hours=1)
for name, since, until in (("operator", now - hour, ends), ("supervisor", ends, ends + hour)):
    Booking.objects.create(
        robot=Robot.objects.get(slug="%s"), person=User.objects.get(username=name),
        starts_at=since, ends_at=until, held_until=until, made_at=now - 2 * hour,
    )
"""


def test_the_end_of_the_slot_ends_the_drive(stack: Stack) -> None:
    """The last test of the shared console: after this, another person has the robot's slot."""
    api = Api(stack, token(stack, "operator", "read", "drive"))
    robot = f"/robots/{ROBOT}"
    assert api("POST", f"{robot}/control", {})[0] == 200
    x = api("GET", robot)[1]["state"]["location"]["x"]
    status, task = api("POST", f"{robot}/go", {"place": "charging dock" if x < 5.0 else "kitchen"})
    assert status == 202, task
    command = stack.manage("slots", "shell", "-c", SLOT_ENDS % ROBOT)
    end = _end(api, task["number"])
    assert end["outcome"] == "control_lost", end
    assert command.wait(10.0)
    assert api("POST", f"{robot}/go", {"place": "kitchen"})[1]["code"] == "no_lease"
    assert api("GET", robot)[1]["state"]["going"] is None
