"""The camera on the control page: a real browser, all real processes, a simulated robot's pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import pytest
from playwright.sync_api import expect

from script.generate.pictures import WAY_IS_DRAWN
from tests.browser.course import Follower, pushed
from tests.browser.people import Fingers, Person
from tests.browser.test_first_visit import keep_choices

Arrive = Callable[..., Person]
pytestmark = pytest.mark.usefixtures("tiago_one")
# Points before, in and behind the east door; metres from the start.
THROUGH_THE_DOOR = ((-0.05, 0.8), (-0.05, 1.5), (-0.05, 2.4))


def shows_a_picture(person: Person) -> None:
    """Wait for the camera's picture. Until it comes, words in its place name what is missing."""
    expect(person.part("camera")).to_be_visible()
    expect(person.part("camera").locator(".camera-words")).to_be_hidden()


def test_the_camera_is_shown_and_its_picture_turns_the_head(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-1")
    shows_a_picture(operator)
    operator.until(lambda: operator.sent.count("camera_view") > 1, "the picture's age on its way to the gate")
    x, y = operator.middle_of("camera-floor")
    operator.page.mouse.move(x, y)
    operator.page.mouse.down()
    for step in range(1, 9):
        operator.page.mouse.move(x + 10 * step, y)
        operator.page.wait_for_timeout(100)
    operator.page.mouse.up()
    operator.until(lambda: operator.sent.count("turn_head") > 1, "turns of the head")
    operator.page.mouse.dblclick(x, y)
    operator.until(lambda: "look_ahead" in operator.sent, "the way back")
    views = operator.part("views")
    views.get_by_role("button", name="Plan").click()
    operator.until(lambda: "camera_end" in operator.sent, "the camera's end")
    expect(operator.part("camera")).to_be_hidden()
    views.get_by_role("button", name="Camera").click()
    shows_a_picture(operator)
    with operator.page.expect_download() as download:
        operator.part("snapshot").click()
    assert download.value.suggested_filename.startswith("tiago-1-head-")
    operator.release()
    assert operator.complaints == []


def test_a_second_finger_stops_while_the_first_looks_around(person: Arrive) -> None:
    operator = person("operator", width=390, height=844, touch=True)
    operator.take("tiago-1")
    shows_a_picture(operator)
    fingers = Fingers(operator)
    x, y = operator.middle_of("camera-floor")
    fingers.put(1, (x, y))
    fingers.move(1, (x + 60, y))
    fingers.put(2, operator.middle_of("stop"))
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "confirmed standstill")
    fingers.move(1, (x + 90, y))
    operator.until(lambda: "turn_head" in operator.sent, "a turn of the head")
    fingers.lift(2)
    fingers.lift(1)
    operator.clear()
    operator.release()
    assert operator.complaints == []


def test_the_whole_screen_keeps_joystick_and_stop(person: Arrive) -> None:
    operator = person("operator", width=844, height=390)
    operator.take("tiago-1")
    shows_a_picture(operator)

    def is_free(name: str) -> bool:
        hit = "([x, y, name]) => Boolean(document.elementFromPoint(x, y).closest(`[data-part=${name}]`))"
        return bool(operator.page.evaluate(hit, [*operator.middle_of(name), name]))

    operator.part("view-open").click()
    operator.part("full-screen").click()
    expect(operator.page.locator("main[data-full]")).to_be_visible()
    assert is_free("zone") and is_free("stop")
    operator.part("view-open").click()
    assert is_free("stop")
    operator.part("stop").get_by_role("button").click()
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "confirmed standstill")
    operator.part("view-open").click()
    operator.part("full-screen").click()
    expect(operator.page.locator("main[data-full]")).to_have_count(0)
    operator.clear()
    operator.release()
    assert operator.complaints == []


def test_a_newcomer_drives_by_the_phones_camera_to_the_next_room(person: Arrive) -> None:
    """With the hints of a first visit: the picture, the door, a look around, and a stop by a second finger."""
    operator = person("operator", width=390, height=844, touch=True, newcomer=True, apart=True)
    keep_choices(operator, "hints_seen=false")
    operator.open("/")
    operator.page.get_by_role("link", name="Open TIAGo One").click()
    shows_a_picture(operator)
    expect(operator.part("picture-area")).to_have_attribute("data-view", "camera")
    hint = operator.part("first-steps")
    expect(hint).to_contain_text("1 of 3")
    operator.press("Take control")
    operator.until_in_control()
    fingers = Fingers(operator)

    follow(operator, fingers, THROUGH_THE_DOOR)
    operator.until_still()
    assert operator.place[1] > 2.0, "not in the next room"  # the door is 1.5 m from the start

    operator.until(lambda: heading(operator) is not None, "a picture with its pose")
    ahead = heading(operator) or 0.0
    x, y = operator.middle_of("camera-floor")
    fingers.put(1, (x, y))
    for step in range(1, 7):
        fingers.move(1, (x + 15 * step, y))
        operator.page.wait_for_timeout(50)
    fingers.lift(1)
    operator.until(
        lambda: (heading(operator) or ahead) > ahead + 0.1, "a picture of the place farther to the left"
    )

    expect(hint).to_contain_text("3 of 3")
    put_on_the_stick(operator, fingers, forward=0.0, left=1.0)
    operator.until(lambda: operator.state["odometry"]["w"] > 0.1, "a turn")
    fingers.put(2, operator.middle_of("stop"))
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "confirmed standstill")
    operator.until_still()
    fingers.lift(2)
    fingers.lift(1)
    expect(hint).to_be_hidden()
    operator.clear()
    operator.release()
    assert operator.complaints == []


def heading(person: Person) -> float | None:
    """Return the newest picture's direction, radians to the left of the robot's; None while the head moves."""
    pose = person.heard["picture"]["pose"]
    return math.atan2(pose[9], pose[8]) if pose else None


def put_on_the_stick(person: Person, fingers: Fingers, *, forward: float, left: float) -> None:
    """Put the first finger on the joystick's middle and move it to this position; 1 is beyond full stick."""
    fingers.put(1, person.middle_of("zone"))
    move_on_the_stick(person, fingers, forward=forward, left=left)


def move_on_the_stick(person: Person, fingers: Fingers, *, forward: float, left: float) -> None:
    """Move the finger that is on the joystick."""
    x, y = person.middle_of("zone")
    fingers.move(1, (x - person.stick_reach * left, y - person.stick_reach * forward))
    person.page.wait_for_timeout(30)


def follow(person: Person, fingers: Fingers, course: Sequence[tuple[float, float]]) -> None:
    """Drive by the joystick with one finger; check that the way is drawn into the picture during the drive."""
    follower, sees_way = Follower(course), False
    put_on_the_stick(person, fingers, forward=0.0, left=0.0)

    def arrived() -> bool:
        nonlocal sees_way
        if person.state["neutral_needed"]:  # on a busy computer a scan or a command came too late
            fingers.lift(1)
            person.until(lambda: person.state["neutral_needed"] is None, "a free stick")
            put_on_the_stick(person, fingers, forward=0.0, left=0.0)
        odometry = person.state["odometry"]
        forward, turn = follower.stick(odometry["x"], odometry["y"], odometry["yaw"])
        move_on_the_stick(person, fingers, forward=forward, left=pushed(turn))
        sees_way = sees_way or (odometry["vx"] > 0.1 and person.page.evaluate(WAY_IS_DRAWN))
        return follower.arrived

    person.until(arrived, "the next room", timeout_s=90.0)
    fingers.lift(1)
    assert sees_way, "no way on the floor of the picture"
