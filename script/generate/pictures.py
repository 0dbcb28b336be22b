"""script/pictures: takes the screenshots of README and docs from a running console."""

from __future__ import annotations

import asyncio
import math
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import PIL.Image
from playwright.sync_api import Browser, Page, sync_playwright
from playwright.sync_api import TimeoutError as NotYet

from robots.shared import wire
from script.stack.client import DRIVE_PERIOD_S, Driver, sign_in
from script.stack.demo import STUDENTS
from script.stack.places import REPOSITORY
from script.stack.stack import PRACTICE_ROBOTS, Stack, temporary_stack

PICTURES = REPOSITORY / "docs/img"
ROBOT = "tiago-3"  # tiago-2 is booked by a student
TWO_CAMERAS = "tiago-2"
DRIVEN_S = 20.0
UNDER_WAY_S = 5.0  # after this time a robot that was sent to a place has driven some metres
SETTLED_S = 1.0  # after this time earlier notices have gone
REPEAT_S = 0.5  # a held key repeats; one that is silent for long counts as released
TRIES = 4
KEPT_AFTER_S = 15.0  # a black box has so much after its event

TOUR_ROBOT = "tiago-1"
TOUR = (  # through the hall into a room: metres ahead and to the left of the start; share of full speed
    (1.8, -0.7, 0.8),
    (3.4, -0.6, 0.8),
    (3.8, 0.4, 0.4),
    (3.8, 1.8, 0.3),
    (2.6, 2.6, 0.6),
)
THERE_M = 0.25
STILL_MPS = 0.01
TURN_PER_RAD = 1.5
SENTENCES = ("Good morning. I am on my way to the workshop.", "Excuse me, may I pass, please?")
LOOKED_AT = 10  # seconds after the start of the control session

ENROLLED = ("Ada", "Bea", "Chen", "Dora", "Emil", "Fatma", "Goran", "Hana", "Ivo", "Jin", "Kofi", "Lea")

# Search for green pixels over the picture: these are the way; the hints at the edges are red.
WAY_IS_DRAWN = """() => {
  if (/middle|overloaded|silent/.test(document.querySelector("[data-part=reason]").textContent)) return false;
  if (document.querySelector("[data-part=camera]").dataset.old !== undefined) return false;
  const canvas = document.querySelector("[data-part=camera-floor]");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  for (let i = 0; i < data.length; i += 4)
    if (data[i + 3] > 0 && data[i + 1] > 1.5 * data[i]) return true;
  return false;
}"""
EVERY_THUMBNAIL = (
    """() => [...document.querySelectorAll("[data-thumbnail]")].every((one) => one.width !== 300)"""
)

SCENE = "document.querySelector('[data-part=scene]').scene"
ROBOT_IS_DRAWN = (
    f"() => {SCENE}?.figures.links > 15 && {SCENE}.figures.hasMap && {SCENE}.figures.points > 100"
)
HOLD_IS_DRAWN = f"() => {SCENE}.figures.holds && {SCENE}.figures.points > 500"

LOOKING_AROUND = "Inspect surroundings"
HEAD = ("head_1_joint", "head_2_joint")
PLOTTED_S = 7.0  # after this time the plot shows a curve

SET_FAULTS = """
import sys, time
import robots.bridge.ros, rospy
from std_msgs.msg import String
rospy.init_node("faults", anonymous=True)
faults = rospy.Publisher("/ground_truth/fault", String, queue_size=1)
while not faults.get_num_connections():
    time.sleep(0.01)
faults.publish(sys.argv[1])
while rospy.wait_for_message("/ground_truth/faults", String).data != sys.argv[1]:
    pass
"""

# Mark the hints for newcomers as read.
BEEN_HERE = """{
  const kept = JSON.parse(localStorage.getItem("fleet-console") ?? "{}");
  const read = { "hints_seen operator": true, "hints-seen staff": true };
  localStorage.setItem("fleet-console", JSON.stringify({ ...kept, ...read }));
}"""


def main() -> None:
    """Start a console, make a control session, and take all screenshots."""
    PICTURES.mkdir(exist_ok=True)
    first, second, third = PRACTICE_ROBOTS
    robots = (
        replace(first, pose=(3.8, 2.4, 0.0)),
        second,
        replace(third, pose=(4.0, 2.4, 10.0)),  # in front of a parcel, near the partition and a doorway
    )
    with (
        lichtblick_build() as build,
        tempfile.TemporaryDirectory() as kept,
        temporary_stack(
            robots,
            students=STUDENTS,
            settings={"FLEET_LICHTBLICK": build, "FLEET_RECORDINGS": kept},
        ) as stack,
    ):
        cookie = sign_in(stack, "operator")
        asyncio.run(tour(stack, cookie))
        take_pictures(stack, cookie)


@contextmanager
def lichtblick_build() -> Iterator[str]:
    """Context: a folder that passes for a build of Lichtblick."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "index.html").write_text("<script src=main.js></script>")
        Path(folder, "main.js").touch()
        yield folder


def take_pictures(stack: Stack, cookie: str) -> None:
    """Take all screenshots, into `PICTURES`."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium",
            args=["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"],
        )
        with page_of(stack, browser, cookie, 1440, 900, "light") as page:
            use_the_drawer(page, stack)
            drive_towards_the_parcel(page, stack)
            page.screenshot(path=PICTURES / "control.png")
            page.keyboard.up("w")
            show_faults(page, stack)
            for tab, in_use in TABS.items():
                page.goto(f"{stack.url}/robots/{ROBOT}/#{tab}")
                page.locator(f".control[data-tab={tab}] .hit:visible").first.wait_for()
                in_use(page)
                page.wait_for_timeout(1000.0 * SETTLED_S)
                page.locator("[data-part=notices] li", has_text="Speakers").wait_for(state="hidden")
                wait_for_the_camera(page)
                page.screenshot(path=PICTURES / f"{tab}.png")
            page.locator("[data-part=actions]").get_by_role("button", name="Release").click()
            page.goto(f"{stack.url}/")
            page.get_by_text("Online").nth(len(stack.robots) - 1).wait_for()
            page.wait_for_function(EVERY_THUMBNAIL)
            page.screenshot(path=PICTURES / "fleet.png")
            use_phones(stack, browser, cookie)  # before the robot stands close to an obstacle
            send_to_a_place(page, stack)
            look_in_3d(page, stack)
            look_back(page, stack)
            page.screenshot(path=PICTURES / "session.png")
            show_bookings(page, stack)
            replay_a_stop(page, stack)
        with page_of(stack, browser, cookie, 1440, 900, "light") as page:
            look_through_cameras(page, stack)
            open_in_lichtblick(page, stack)
        with page_of(stack, browser, sign_in(stack, "observer"), 1920, 1080, "light") as page:
            page.goto(f"{stack.url}/?wall")
            page.get_by_text("Online").nth(len(stack.robots) - 1).wait_for()
            page.wait_for_function(EVERY_THUMBNAIL)
            page.screenshot(path=PICTURES / "wall.png")
        with page_of(stack, browser, sign_in(stack, "staff"), 1100, 900, "light") as page:
            make_a_course(page, stack.url)
        browser.close()
    for file in PICTURES.glob("*.png"):
        shrink(file)


@contextmanager
def page_of(
    stack: Stack, browser: Browser, cookie: str, width: int, height: int, theme: str, *, scale: float = 1
) -> Iterator[Page]:
    """Context: a page of this size, signed in."""
    context = browser.new_context(
        viewport={"width": width, "height": height},
        color_scheme=theme,  # type: ignore[arg-type]
        device_scale_factor=scale,
        has_touch=width < 1000,
    )
    pairs = (pair.split("=", 1) for pair in cookie.split("; "))
    context.add_cookies([{"name": name, "value": value, "url": stack.url} for name, value in pairs])
    context.add_init_script(BEEN_HERE)
    try:
        yield context.new_page()
    finally:
        context.close()


def wait_for_the_camera(page: Page) -> None:
    """Wait until the page shows a new camera picture, and no banner (such as one about a busy computer)."""
    page.locator("[data-part=camera] .camera-words").wait_for(state="hidden")
    page.locator("[data-part=camera]:not([data-old])").wait_for()


def shrink(file: Path) -> None:
    """Reduce the picture to 256 colours: a third of the bytes, without a visible difference."""
    with PIL.Image.open(file) as picture:
        few = picture.convert("RGB").quantize(256, dither=PIL.Image.Dither.NONE)
    few.save(file, optimize=True)


def open_in_lichtblick(page: Page, stack: Stack) -> None:
    """Take the dialog for Lichtblick."""
    page.goto(f"{stack.url}/robots/{ROBOT}/#topics")
    page.get_by_role("button", name="Open in Lichtblick").click()
    page.locator("[data-part=lichtblick-link][href]").wait_for()
    page.locator("[data-part=lichtblick-dialog]").screenshot(path=PICTURES / "lichtblick.png")


def show_bookings(page: Page, stack: Stack) -> None:
    """Take the calendar of all robots, with bookings."""
    page.goto(f"{stack.url}/bookings/")
    page.locator(".ec-event").first.wait_for()
    page.screenshot(path=PICTURES / "bookings.png")


def send_to_a_place(page: Page, stack: Stack) -> None:
    """Take the map and the fleet map while the robot drives to a named place, then cancel."""
    take_control(page, stack)
    page.get_by_role("button", name="Map", exact=True).click()
    for _ in range(TRIES):  # on a busy computer a drive may end early
        page.wait_for_timeout(1000.0 * SETTLED_S)  # until the bridge has measured that the robot stands
        page.get_by_role("button", name="Places").click()
        page.get_by_role("button", name="charging dock", exact=True).click()
        with suppress(NotYet):
            page.get_by_text(re.compile("Drives to “charging dock”: .* m left")).wait_for(timeout=5000)
            page.wait_for_timeout(1000.0 * UNDER_WAY_S)
            page.locator("[data-part=reason]").wait_for(state="hidden", timeout=5000)
            page.locator("[data-part=going-cancel]").wait_for(timeout=1000)
            page.screenshot(path=PICTURES / "map.png")
            look_at_the_plan(page, stack)
            break
    else:
        raise TimeoutError("The robot did not drive for long enough.")
    if (cancel := page.locator("[data-part=going-cancel]")).is_visible():
        cancel.click()
    page.locator("[data-part=actions]").get_by_role("button", name="Release").click()


def replay_a_stop(page: Page, stack: Stack) -> None:
    """Take the replay of the newest black box, at its middle."""
    for _ in range(TRIES):
        page.goto(f"{stack.url}/recordings/?kind=black_box")
        if (newest := page.locator(".recordings h2 a").first).count():
            break
        page.wait_for_timeout(1000.0 * KEPT_AFTER_S)
    newest.click()
    page.locator("[data-part=camera]").wait_for()
    page.locator("[data-part=plot-topic]").select_option("/fleet/view")
    page.locator("[data-part=plot-field]").select_option("state.odometry.vx")
    page.wait_for_timeout(1000.0 * SETTLED_S)
    page.screenshot(path=PICTURES / "replay.png")


def look_in_3d(page: Page, stack: Stack) -> None:
    """Drive towards an obstacle until the gate slows the robot down, and take the 3D view of it."""
    take_control(page, stack)
    page.get_by_role("button", name="3D").click()
    page.wait_for_function(ROBOT_IS_DRAWN)
    drive_until(page, HOLD_IS_DRAWN)
    page.screenshot(path=PICTURES / "scene.png")
    page.keyboard.up("w")
    page.get_by_role("button", name="Plan").click()
    page.locator("[data-part=actions]").get_by_role("button", name="Release").click()


def look_at_the_plan(page: Page, stack: Stack) -> None:
    """Take the fleet map, in another window: another tab would hide the robot's page, and the drive would end."""
    browser = page.context.browser
    assert browser is not None  # noqa: S101 - it opened the page
    window = browser.new_context(
        viewport={"width": 1440, "height": 700}, storage_state=page.context.storage_state()
    )
    plan = window.new_page()
    plan.goto(f"{stack.url}/plan/")
    try:
        plan.locator("[data-part=maps] canvas").wait_for()
        plan.get_by_text("Drives to “charging dock”").wait_for(timeout=10_000)
        plan.wait_for_timeout(1000.0 * SETTLED_S)
        plan.screenshot(path=PICTURES / "plan.png")
    finally:
        window.close()


def drive_towards_the_parcel(page: Page, stack: Stack) -> None:
    """Hold W until the picture shows the way on the floor."""
    take_control(page, stack)
    wait_for_the_camera(page)
    drive_until(page, WAY_IS_DRAWN)


def drive_until(page: Page, shown: str) -> None:
    """Hold W, which repeats as at a real keyboard, until the page shows this (a function in JavaScript)."""
    for _ in range(3 * TRIES):  # on a busy computer the stick has to return to the middle
        for _ in range(round(DRIVEN_S / 3 / REPEAT_S)):
            page.keyboard.down("w")
            with suppress(NotYet):
                page.wait_for_function(shown, timeout=1000.0 * REPEAT_S)
                return
        page.keyboard.up("w")
        page.wait_for_timeout(1000.0 * REPEAT_S)
    raise TimeoutError(f"Not shown while the robot drove: {shown}")


def use_phones(stack: Stack, browser: Browser, cookie: str) -> None:
    """Take the control page on a phone, held sideways and upright."""
    for name, width, height in (("phone", 844, 390), ("phone-upright", 360, 640)):
        with page_of(stack, browser, cookie, width, height, "dark", scale=2) as page:
            take_control(page, stack)
            page.locator("[data-part=delay]", has_text=re.compile(r"\d ms")).wait_for()
            page.locator("[data-part=reason]").wait_for(state="hidden")
            wait_for_the_camera(page)
            page.screenshot(path=PICTURES / f"{name}.png")
            page.locator("[data-part=actions]").get_by_role("button", name="Release").click()


def use_the_drawer(page: Page, stack: Stack) -> None:
    """Take the camera with the drawer of gripper and torso, before anything turns the head."""
    take_control(page, stack)
    page.get_by_role("button", name="Robot", exact=True).click()
    page.get_by_role("button", name="Head", exact=True).click()
    page.locator("[data-part=gripper-at]", has_text="cm").wait_for()
    wait_for_the_camera(page)
    page.locator("[data-part=camera]").screenshot(path=PICTURES / "limbs.png")
    page.get_by_role("button", name="Head", exact=True).click()
    page.locator("[data-part=actions]").get_by_role("button", name="Release").click()


def look_through_cameras(page: Page, stack: Stack) -> None:
    """Take two cameras at the same time, then a camera picture that is old."""
    page.goto(f"{stack.url}/robots/{TWO_CAMERAS}/")
    page.get_by_role("button", name="Camera", exact=True).click()
    page.get_by_role("button", name="Second camera").click()
    page.locator("[data-part=second] .camera-words").wait_for(state="hidden")
    wait_for_the_camera(page)
    page.locator("[data-part=picture-area]").screenshot(path=PICTURES / "cameras.png")
    set_faults(stack, "camera_dead", TWO_CAMERAS)
    page.get_by_text(re.compile(r"picture [2-4] s old")).wait_for()
    page.locator("[data-part=camera]").screenshot(path=PICTURES / "camera-old.png")
    set_faults(stack, "none", TWO_CAMERAS)


def show_faults(page: Page, stack: Stack) -> None:
    """Take the page after two parts of the robot have reported faults."""
    set_faults(stack, "motor_hot,part_broken")
    page.locator("[data-part=health-open]").click()
    page.locator("[data-part=health-parts] li").nth(1).wait_for()
    page.locator(".notice", has_text="Speakers").wait_for()
    page.screenshot(path=PICTURES / "health.png", clip={"x": 0, "y": 0, "width": 1440, "height": 470})
    set_faults(stack, "none")
    page.keyboard.press("Escape")


def take_control(page: Page, stack: Stack) -> None:
    """Open the robot's page and take control."""
    page.goto(f"{stack.url}/robots/{ROBOT}/")
    page.get_by_role("button", name="Take control").click()
    page.get_by_role("button", name="Release").wait_for()


def set_faults(stack: Stack, names: str, robot: str = ROBOT) -> None:
    """Set the faults of a simulated robot, by a program that waits until the simulator has received them."""
    subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", SET_FAULTS, names],
        cwd=REPOSITORY,
        env=stack.robots[robot].environment,
        check=True,
    )


def make_a_course(page: Page, url: str) -> None:
    """Take the pictures for teachers: the preview of a list of people, and the course's page."""
    page.goto(f"{url}/courses/new/")
    page.get_by_label("Name", exact=True).fill("Human-robot interaction")
    page.get_by_label("Last day").fill(f"{datetime.now(UTC) + timedelta(days=120):%Y-%m-%d}")
    for box in page.get_by_role("checkbox").all()[:3]:
        box.check()
    people = [f"{name} Lovelace <{name.lower()}@example.org>" for name in ENROLLED]
    page.get_by_label("People", exact=True).fill("\n".join([*people, "Carl Error, carl(at)example.org"]))
    page.get_by_text("Quotas of bookings").click()
    page.get_by_label("Hours per person and week").fill("2")
    page.get_by_role("button", name="Make the course").click()
    page.get_by_role("heading", name="Please check the list").wait_for()
    page.screenshot(path=PICTURES / "course-list.png")
    page.get_by_role("button", name="Make the course").first.click()
    page.get_by_role("link", name="Enrol people").wait_for()
    page.get_by_role("checkbox").nth(1).check()
    page.get_by_role("button", name="Grant").click()
    page.get_by_role("link", name="Enrol people").wait_for()
    page.get_by_role("button", name="Make a link").click()
    page.get_by_role("link", name="Back").click()
    page.get_by_role("link", name="Enrol people").wait_for()
    page.screenshot(path=PICTURES / "course.png")


def say_a_phrase(page: Page) -> None:
    """Speak a phrase, and wait until it is in the history."""
    page.locator("[data-part=phrase-list] .hit").first.click()
    page.locator("[data-part=history-list] .hit").first.wait_for()


def watch_the_head(page: Page) -> None:
    """Plot both joints of the head while the robot looks around."""
    page.get_by_role("tab", name="Motions").click()
    page.locator(".motions .hit", has_text=LOOKING_AROUND).click()
    page.get_by_role("button", name="Cancel the motion").wait_for()
    page.get_by_role("tab", name="Topics").click()
    page.get_by_role("searchbox", name="Search topics").fill("joint_states")
    page.locator("[data-part=topic-list] .hit:visible").click()
    watch = page.locator("[data-part=watches]")
    watch.get_by_role("button", name="Elements of position").click()
    fields = watch.locator(".field-list > div").filter(has=page.get_by_text("name", exact=True)).locator("dd")
    names = (fields.text_content() or "").strip("[]").split(", ")
    for joint in HEAD:
        at = f"position[{names.index(joint)}]"
        watch.get_by_role("button", name=f"Plot {at}", exact=True).click()
    page.locator(".topics").evaluate("topics => topics.scrollTo(0, 0)")
    page.wait_for_timeout(1000.0 * PLOTTED_S)


async def tour(stack: Stack, cookie: str) -> None:
    """Make a control session: the robot speaks, drives through a doorway, and waves."""
    async with Driver(stack, TOUR_ROBOT, cookie) as driver:
        fence = await driver.take()
        await driver.until(lambda: driver.odometry)
        for number, (x, y, share) in enumerate(TOUR):
            if number % 2 == 0 and number // 2 < len(SENTENCES):
                await driver.request_task(wire.Say(fence, SENTENCES[number // 2], "en-GB"))
            await drive_to(driver, x, y, share)
        await driver.drive(0.0, 0.0)
        await driver.until(lambda: driver.odometry and abs(driver.odometry.vx) < STILL_MPS)
        await asyncio.sleep(SETTLED_S)
        await driver.request_task(wire.Play(fence, "wave"))
        await driver.until(lambda: driver.state and driver.state.motion_ended, timeout_s=DRIVEN_S)
        await driver.send(wire.Release())
        await driver.until(lambda: driver.fence is None)


async def drive_to(driver: Driver, x: float, y: float, share: float) -> None:
    """Steer the robot to a point: metres ahead and to the left of its start."""
    end_s = time.monotonic() + DRIVEN_S
    while time.monotonic() < end_s and (at := driver.odometry):
        if math.hypot(x - at.x, y - at.y) < THERE_M:
            return
        astray = math.remainder(math.atan2(y - at.y, x - at.x) - at.yaw, math.tau)
        turn = max(-1.0, min(1.0, TURN_PER_RAD * astray))
        if driver.state and driver.state.neutral_needed:
            await driver.drive(0.0, 0.0)
        else:
            await driver.drive(max(math.cos(astray), 0.0), turn, share)
        await asyncio.sleep(DRIVE_PERIOD_S)
    raise TimeoutError(f"{TOUR_ROBOT} did not come to {x}, {y}; {driver.said_last()}")


def look_back(page: Page, stack: Stack) -> None:
    """Open the page of the control session, at a moment in the middle of the tour."""
    page.set_viewport_size({"width": 1440, "height": 1000})
    page.goto(f"{stack.url}/your-data/")
    page.get_by_role("link", name="TIAGo One").first.click()
    page.locator("[data-part=marker][visibility=visible]").wait_for()
    page.locator("[data-part=moment]").focus()
    for _ in range(LOOKED_AT):
        page.keyboard.press("ArrowRight")
    page.locator(":focus").evaluate("slider => slider.blur()")


def do_nothing(_page: Page) -> None:
    """Do nothing."""


TABS = {"motions": do_nothing, "speech": say_a_phrase, "topics": watch_the_head}


if __name__ == "__main__":
    main()
