"""The camera on the control page: a real browser, all real processes, a simulated robot's pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from script.stack.stack import Stack
from tests.browser.conftest import ROBOTS
from tests.browser.people import Fingers, Person, running_stack
from tests.browser.test_pages import found_by_axe

Arrive = Callable[..., Person]


@pytest.fixture(scope="module")
def stack_with_camera(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """A console of its own: the camera's pictures cost other tests no computing time."""
    with running_stack(tmp_path_factory.mktemp("camera"), [replace(ROBOTS[0], camera=True)]) as stack:
        yield stack


@pytest.fixture
def person(stack_with_camera: Stack, browser: Browser) -> Iterator[Arrive]:
    """`person("operator")`: a signed-in person of that console."""
    with ExitStack() as leaving:

        def arrive(role: str, **looks: Any) -> Person:
            somebody = Person(stack_with_camera, browser, role, **looks)
            somebody.sign_in()
            leaving.callback(somebody.leave)
            return somebody

        yield arrive


def shows_a_picture(person: Person) -> None:
    """Wait for the camera's picture: its words say what is missing until then."""
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
    for theme in ("light", "dark"):
        operator.page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
        assert found_by_axe(operator) == [], theme
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
