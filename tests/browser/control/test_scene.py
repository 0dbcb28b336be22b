"""The robot in 3D on the control page: its description, live joints, and a text if it cannot be drawn."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from playwright.sync_api import Browser, Route, expect

from script.stack.stack import Stack
from tests.browser.conftest import ARGUMENTS, CHROMIUM
from tests.browser.people import Person
from tests.browser.test_pages import axe_accepts_everywhere

Draw = Callable[..., Person]
SCENE = "document.querySelector('[data-part=scene]').scene"
LOSE = """() => document.querySelector(".scene-canvas").getContext("webgl2")
  .getExtension("WEBGL_lose_context").loseContext()"""
BASE = '<link name="base"><visual><geometry><mesh filename="{}"/></geometry></visual></link>'


@pytest.fixture
def launched(
    stack: Stack, browser: Browser, cookies: Callable[[str], Any]
) -> Iterator[Callable[[str], Draw]]:
    """`launched(flag)("operator")`: a signed-in person in a separate browser with this flag."""
    with ExitStack() as leaving:

        def launch(*flags: str) -> Draw:
            other = browser.browser_type.launch(executable_path=CHROMIUM, args=[*ARGUMENTS, *flags])
            leaving.callback(other.close)

            def arrive(role: str, **looks: Any) -> Person:
                somebody = Person(stack, other, role, **looks)
                leaving.callback(somebody.leave)
                somebody.context.add_cookies(cookies(role))
                return somebody

            return arrive

        yield launch


@pytest.fixture
def person(launched: Callable[..., Draw]) -> Draw:
    """`person("operator")`: a signed-in person whose browser draws 3D by software."""
    return launched("--enable-unsafe-swiftshader")


def figures(person: Person) -> dict[str, Any]:
    """Facts about the drawn scene; none before the module is loaded."""
    found: dict[str, Any] = person.page.evaluate(f"{SCENE}?.figures ?? {{}}")
    return found


def joint(person: Person, name: str) -> float | None:
    """Return the position in which the joint is drawn."""
    found: float | None = person.page.evaluate(f"{SCENE}.joint('{name}')")
    return found


def opened(person: Person) -> None:
    """Open the 3D view and wait until the robot is drawn."""
    if person.part("view-open").is_visible():
        person.part("view-open").click()
    person.press("3D")
    person.until(lambda: figures(person).get("links", 0) > 15, "the robot’s links")
    person.until(lambda: joint(person, "arm_2_joint") is not None, "the arm’s joints")


def test_the_arm_moves_in_3d_as_the_robot_moves_it(person: Draw) -> None:
    operator = person("operator")
    loaded: list[str] = []
    operator.page.on("request", lambda request: loaded.append(request.url))
    operator.take("tiago-2")
    assert not any("/scene_view" in url or "/description" in url for url in loaded)
    assert "joints" not in operator.heard["view"]
    operator.fold_arm()
    opened(operator)
    assert sum("/scene_view" in url for url in loaded) == 1
    home = joint(operator, "arm_1_joint")
    operator.press("Play Wave")
    operator.until(lambda: abs(joint(operator, "arm_1_joint") - home) > 0.5, "an arm that moves in 3D")
    operator.until(lambda: operator.state["motion"] is None, "the end of the motion")
    reported = operator.heard["view"]["joints"]["arm_4_joint"]
    operator.until(
        lambda: abs(joint(operator, "arm_4_joint") - reported) < 0.02, "the arm where the robot has it"
    )
    assert figures(operator)["points"] > 100

    operator.press("Plan")
    expect(operator.part("scene")).to_be_hidden()
    operator.until(lambda: "joints" not in operator.heard["view"], "views without joints")
    drawn = figures(operator)["frames"]
    operator.fold_arm()
    assert figures(operator)["frames"] == drawn
    operator.release()
    assert [said for said in operator.complaints if "404" not in said] == []  # at first the robot has no map


def test_the_scene_is_turned_by_keys_which_do_not_drive(person: Draw) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    opened(operator)
    start = operator.place
    canvas = operator.page.locator(".scene-canvas")
    canvas.focus()
    before = figures(operator)["eye"]
    operator.page.keyboard.press("ArrowLeft")
    operator.until(lambda: figures(operator)["eye"] != before, "another viewpoint")
    operator.page.keyboard.press("t")
    expect(operator.page.get_by_role("button", name="Top", exact=True)).to_have_attribute(
        "aria-pressed", "true"
    )
    operator.press("Follow")
    expect(operator.page.get_by_role("button", name="Follow")).to_have_attribute("aria-pressed", "true")
    assert operator.place == pytest.approx(start, abs=0.02)
    axe_accepts_everywhere(operator, "3D")
    operator.release()


def test_a_browser_without_webgl_says_so(launched: Callable[..., Draw]) -> None:
    observer = launched("--disable-3d-apis")("observer")
    observer.watch("tiago-2")
    observer.press("3D")
    expect(observer.part("scene-words")).to_contain_text("This browser cannot draw in 3D")
    observer.press("Plan")
    expect(observer.part("picture")).to_be_visible()
    expect(observer.part("scene")).to_be_hidden()


def test_a_lost_picture_begins_again_by_itself(person: Draw) -> None:
    observer = person("observer")
    observer.watch("tiago-2")
    opened(observer)
    observer.page.evaluate(LOSE)
    expect(observer.part("scene-words")).to_contain_text("lost the 3D picture")
    expect(observer.part("scene-words")).to_be_hidden()
    frames = figures(observer)["frames"]
    observer.until(lambda: figures(observer)["frames"] > frames + 2, "pictures again")
    for _ in range(3):
        observer.page.evaluate(LOSE)
        expect(observer.part("scene-words")).to_be_visible()
        observer.until(
            lambda: "begins again" not in observer.part("scene-words").inner_text(), "an end of it"
        )
    expect(observer.part("scene-words")).to_contain_text("again and again")


MESHES = {  # by name: status and body of the answer for the mesh, and the page's words about it
    "broken.stl": (200, b"no mesh at all", "is broken"),
    "short.stl": (200, b"\0" * 90, "is broken"),
    "lying.stl": (200, b"\0" * 80 + b"\xff\xff\xff\x7f" + b"\0" * 50, "is broken"),
    "nan.stl": (
        200,
        b"\0" * 80 + b"\1\0\0\0" + b"\0\0\xc0\x7f" * 12 + b"\0\0",
        "is broken",
    ),
    "broken.dae": (200, b"<COLLADA><library_images>", "is broken"),
    "broken.obj": (200, b"v 0 0 0\nf 1 2 3\n", "is broken"),
    "long.obj": (200, b"# " + b"x" * 8_100_000, "8 MB of text"),
    "lost.stl": (404, b"{}", "could not be fetched"),
}


def test_missing_huge_and_broken_meshes_are_named_and_replaced(person: Draw) -> None:
    observer = person("observer")
    names = [f"package://arm/{name}" for name in MESHES]
    entries = [
        {"filename": name, "address": name.replace("package://arm", "/meshes"), "problem": ""}
        for name in names
    ]
    entries.append(
        {"filename": "package://arm/far.stl", "address": None, "problem": "“far.stl” is not here."}
    )
    visuals = "".join(
        BASE.format(entry["filename"]).replace("base", f"base{i}") for i, entry in enumerate(entries)
    )
    joints = "".join(
        f'<joint name="j{i}" type="fixed"><parent link="base{i}"/><child link="base{i + 1}"/>'
        '<origin xyz="0 0 0.2"/></joint>'
        for i in range(len(entries) - 1)
    )
    described = {
        **{
            "digest": "1",
            "seen_at": "2026-01-01T00:00:00Z",
            "problems": ["link x: a shape without geometry"],
        },
        **{"urdf": f'<robot name="r">{visuals}{joints}</robot>', "meshes": entries},
    }

    def answer(route: Route) -> None:
        status, body, _ = MESHES[route.request.url.rpartition("/")[2]]
        route.fulfill(status=status, body=body, content_type="application/octet-stream")

    observer.page.route("**/description", lambda route: route.fulfill(body=json.dumps(described)))
    observer.page.route("**/meshes/*", answer)
    observer.watch("tiago-2")
    observer.press("3D")
    expect(observer.part("scene-more")).to_contain_text(f"{len(MESHES) + 2} notes")
    observer.part("scene-more").locator("summary").click()
    for name, (_, _, words) in MESHES.items():
        line = observer.part("scene-notes").locator("li").filter(has_text=f"/{name}”")
        expect(line).to_contain_text(words)
    expect(observer.part("scene-notes")).to_contain_text("“far.stl” is not here.")
    assert figures(observer)["size"] > len(entries)  # a shape for each mesh, and one for the base
    assert observer.page.evaluate(f"{SCENE}.draws")


def test_a_description_that_cannot_be_drawn_says_why(person: Draw) -> None:
    observer = person("observer")
    refused = {"code": "bad_description", "detail": "The robot cannot be drawn: it has 8 million characters."}
    observer.page.route("**/description", lambda route: route.fulfill(status=409, body=json.dumps(refused)))
    observer.watch("tiago-2")
    observer.press("3D")
    expect(observer.part("scene-words")).to_contain_text("8 million characters")
    observer.until(lambda: figures(observer).get("points", 0) > 100, "what is round the robot")
    assert figures(observer)["size"] == 1  # only the footprint
