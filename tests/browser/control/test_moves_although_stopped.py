"""A stopped robot that other software drives on: every page says so, names who, and what to press."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import expect

from script.stack.stack import Stack
from tests.browser.people import Person, robot_side
from tests.browser.test_pages import axe_accepts

Arrive = Callable[..., Person]
ROBOT = "tiago-2"
TITLE = "The robot moves although it is stopped: press its red button"
WHO = re.compile(r"Velocities for its base come from /usability_rogue\S* on /mobile_base_controller/cmd_vel")


def test_every_page_says_that_a_stopped_robot_moves(person: Arrive, stack: Stack, tmp_path: Path) -> None:
    observer, other = person("supervisor", width=360, height=640, touch=True), person("staff")
    observer.watch(ROBOT)
    with robot_side(stack.robots[ROBOT], "rogue", tmp_path / "said"):
        observer.until(lambda: abs(observer.state["odometry"]["w"]) > 0.1, "a robot that turns")
        observer.part("stop").get_by_role("button").click()
        expect(observer.part("reason-title")).to_have_text(
            "It moves although stopped: press the red button on the robot"
        )
        expect(observer.part("reason-title")).to_be_in_viewport()
        expect(observer.part("reasons-now")).to_have_text(WHO)
        expect(observer.part("alarm")).to_contain_text("It moves although stopped")
        expect(observer.part("stop-state")).to_have_text("It moves!")
        axe_accepts(observer, "a stopped robot that moves")
        for path in ("/", "/?wall"):
            other.open(path)
            card = other.page.locator(f"[data-robot={ROBOT}]")
            expect(card.locator("[data-part=doing]")).to_have_text(TITLE)
            expect(card.locator("[data-part=why]")).to_have_text(WHO)
            assert card.locator("[data-part=why]").evaluate("box => box.scrollWidth <= box.clientWidth")
            expect(card.get_by_role("alert")).to_have_text(TITLE)
        other.open("/")
        axe_accepts(other, "the fleet with a stopped robot that moves")
        again = other.page.request.post(
            f"{stack.url}/robots/{ROBOT}/stop/",
            form={
                "csrfmiddlewaretoken": other.page.locator("[name=csrfmiddlewaretoken]").first.input_value()
            },
            headers={"Accept": "application/json", "Origin": stack.url},
        )
        assert again.json()["text"].startswith("Moves although it is stopped: TIAGo Two.")
        other.open("/plan/")
        expect(other.page.locator(f"[data-robot={ROBOT}] [data-part=doing]")).to_have_text(TITLE)
    expect(observer.part("reason-title")).to_have_text(re.compile("^Stopped by "))
    expect(other.page.locator(f"[data-robot={ROBOT}] [data-part=doing]")).to_have_text("Stopped")
    state = other.page.request.get(f"{stack.url}/api/v1/robots/{ROBOT}").json()["state"]
    assert (state["stands"], state["moves_although_stopped"]) == (True, None)
    observer.clear()
