"""The Topics tab for an operator: choosing input topics, viewing topics, publishing."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import expect

from script.stack.stack import Stack
from tests.browser.people import Person, robot_side
from tests.browser.test_pages import found_by_axe

Arrive = Callable[..., Person]
ROBOT = "tiago-2"
# Make the page a hidden browser tab, which draws nothing. Count how often the page reports a lost connection.
HIDDEN = """() => {
    const draw = window.requestAnimationFrame;
    const held = [];
    let isHidden;
    Object.defineProperty(document, "hidden", { get: () => isHidden });
    window.hide = (hides) => {
        isHidden = hides;
        window.requestAnimationFrame = hides ? (act) => held.push(act) : draw;
        document.dispatchEvent(new Event("visibilitychange"));
        if (!hides) held.forEach((act) => draw(act));
    };
    const page = document.querySelector("[data-page=control]");
    window.cuts = 0;
    const count = () => { window.cuts += "cut" in page.dataset; };
    new MutationObserver(count).observe(page, { attributeFilter: ["data-cut"] });
    hide(true);
}"""


def topics_of(person: Person) -> None:
    """Open the Topics tab and wait for the robot's topics."""
    person.page.get_by_role("tab", name="Topics").click()
    person.part("topic-list").get_by_role("button").first.wait_for()


def test_driving_goes_elsewhere_and_back_with_one_press(person: Arrive) -> None:
    operator = person("operator")
    operator.take(ROBOT)
    topics_of(operator)
    drive = operator.part("uses").get_by_role("listitem").filter(has_text="Drive")
    drive.get_by_role("button", name="Change…").click()
    dialog = operator.part("choose-dialog")
    dialog.get_by_label("Search topics").press("Escape")
    expect(dialog).to_be_hidden()
    drive.get_by_role("button", name="Change…").click()
    dialog.get_by_label("Search topics").fill("vel")
    expect(dialog.get_by_role("button", name="/joy_vel")).to_be_disabled()
    expect(dialog.get_by_role("button", name="/joy_vel")).to_contain_text("not on the allow-list")
    dialog.get_by_label("Search topics").fill("/key_vel")
    expect(dialog.get_by_role("button", name="/key_vel")).to_contain_text("Twist · default")
    dialog.get_by_label("Search topics").fill("odom")
    expect(dialog.get_by_role("button", name="wrong type").first).to_be_disabled()
    dialog.get_by_label("Search topics").fill("phone")
    operator.page.keyboard.press("Enter")
    operator.until(lambda: operator.state["chosen"] == {"drive": "/phone_vel"}, "the choice")
    drive.get_by_text("chosen", exact=True).wait_for()
    assert "/phone_vel" in drive.inner_text()

    operator.page.get_by_role("tab", name="Drive").click()
    operator.drive("ArrowDown", metres=0.05)  # at once: the click changes the tab
    operator.let_go("ArrowDown")
    operator.until_still()
    elsewhere = operator.part("elsewhere").get_by_text("Drive goes to /phone_vel")
    expect(elsewhere).to_be_visible()
    operator.page.get_by_role("tab", name="Speech").click()
    expect(elsewhere).to_be_hidden()  # each tab shows its own redirected input
    operator.page.get_by_role("tab", name="Centre").click()
    operator.press("Drive: Back to the default")
    operator.until(lambda: operator.state["chosen"] == {}, "the default")
    expect(elsewhere).to_be_hidden()

    topics_of(operator)
    drive.get_by_role("button", name="Change…").click()
    dialog.get_by_role("button", name="/phone_vel").click()
    drive.get_by_text("chosen", exact=True).wait_for()
    drive.get_by_role("button", name="Back to the default").click()
    operator.until(lambda: operator.state["chosen"] == {}, "the default")
    drive.get_by_text("default", exact=True).wait_for()
    operator.release()
    assert operator.complaints == []


def test_focus_returns_with_the_browser_tab(person: Arrive) -> None:
    observer = person("observer")
    observer.watch(ROBOT)
    topics_of(observer)
    search = observer.part("topic-list").get_by_role("searchbox")
    search.focus()
    observer.page.evaluate(HIDDEN)
    observer.page.wait_for_timeout(3500)  # the page acknowledges only drawn pictures, so no more arrive
    observer.heard.pop("view")
    observer.page.evaluate("hide(false)")
    observer.until(lambda: "view" in observer.heard, "pictures again")
    assert observer.page.evaluate("cuts") == 0
    expect(search).to_be_focused()


def test_a_type_that_is_installed_nowhere_is_watched_and_plotted(
    person: Arrive, stack: Stack, tmp_path: Path
) -> None:
    observer = person("observer")
    observer.watch(ROBOT)
    with robot_side(stack.robots[ROBOT], "unknown", tmp_path / "said"):
        topics_of(observer)
        row = observer.part("topic-list").get_by_role("button", name="/weather")
        while not row.count():
            observer.part("topics-refresh").click()
            observer.page.wait_for_timeout(200)
        row.click()
        watched = observer.part("watches").get_by_label("/weather")
        watched.get_by_text("Take a coat.").wait_for()
        watched.get_by_text(re.compile(r"10(\.\d)? Hz")).wait_for()
        expect(watched).to_contain_text("7.5")
        watched.get_by_role("button", name="Plot celsius").click()
        watched.locator("canvas").wait_for()
        observer.page.get_by_role("tab", name="Drive").click()
        observer.page.get_by_role("tab", name="Topics").click()  # subscriptions are renewed
        watched.locator("canvas").wait_for()
        expect(watched).not_to_have_attribute("data-stale", "true")
        assert found_by_axe(observer) == []
        watched.get_by_role("button", name="Close").click()
        expect(watched).to_have_count(0)
    assert observer.complaints == []


def test_list_elements_are_plotted_and_long_rows_fit(person: Arrive) -> None:
    observer = person("observer", width=360, height=640, touch=True)
    observer.watch(ROBOT)
    topics_of(observer)
    observer.part("topic-list").get_by_role("searchbox").fill("/joint_states")
    observer.page.keyboard.press("Enter")
    watched = observer.part("watches").get_by_label("/joint_states")
    watched.get_by_role("button", name="Elements of position").click()
    for element in range(6):
        watched.get_by_role("button", name=f"Plot position[{element}]").click()
    watched.locator("canvas").wait_for()
    markers = watched.locator(".u-marker").evaluate_all("all => all.map(one => one.style.border)")
    assert len(set(markers)) == 6  # each line looks different
    overlapping = "rows => rows.filter(row => row.scrollHeight > row.clientHeight + 1).length"
    assert watched.locator(".field-list > div").evaluate_all(overlapping) == 0
    watched.get_by_role("button", name="Plot position[6]").click()
    observer.part("notices").get_by_text("A plot has at most 6 lines.").wait_for()
    assert observer.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert observer.complaints == []


def test_a_nested_message_is_published_and_errors_name_fields(
    person: Arrive, stack: Stack, tmp_path: Path
) -> None:
    operator = person("operator")
    operator.take(ROBOT)
    topics_of(operator)
    said = tmp_path / "said"
    with robot_side(stack.robots[ROBOT], "hear", said):
        operator.until(said.read_text, "somebody who listens")
        operator.part("publish-topic").select_option("/fleet_demo/place")
        operator.page.locator("#field-header-frame_id").fill("odom")
        operator.page.locator("#field-pose-position-x").fill("far")
        operator.press("Publish")
        expect(operator.page.locator("#field-pose-position-x-note")).to_contain_text("not a number")
        x, plain = (operator.page.locator(f"#field-pose-position-{axis}") for axis in "xy")
        x.fill("near")
        operator.press("Publish")
        expect(x).to_have_attribute("aria-invalid", "true")
        edges = [field.evaluate("field => getComputedStyle(field).borderTopColor") for field in (x, plain)]
        assert edges[0] != edges[1]
        x.fill("1.5")
        operator.press("Publish")
        operator.until(lambda: "odom 1.5 0" in said.read_text(), "the message at the robot")

        operator.part("publish-as").select_option("text")
        operator.part("publish-text").fill('{"pose.position.y": "near"}')
        operator.press("Publish")
        operator.part("publish-fault").get_by_text("pose.position.y").wait_for()
        operator.part("publish-text").fill('{"header.frame_id": "map", "pose.position.y": 2}')
        operator.part("publish-rate").fill("5")
        operator.press("Publish")
        operator.until(lambda: said.read_text().count("map 0 2") > 3, "messages at a rate")
        operator.part("publish-running").get_by_role("button", name="Stop").click()
        operator.until(lambda: operator.state["publishing"] == [], "the end")
    operator.release()


def test_a_published_velocity_passes_the_gate_and_ends_with_tab(
    person: Arrive,
) -> None:
    operator = person("operator")
    operator.take(ROBOT)
    operator.forget()
    topics_of(operator)
    operator.part("publish-topic").select_option("/key_vel")
    operator.page.locator("#field-linear-x").fill("-0.1")
    operator.part("publish-rate").fill("10")
    operator.press("Publish")
    refused = operator.part("notices").get_by_text("Publish a velocity of zero first")
    expect(refused).to_contain_text("no sensor has looked for table tops behind")
    operator.page.locator("#field-linear-x").fill("0")
    operator.press("Publish")
    operator.until(lambda: operator.state["neutral_needed"] is None, "a velocity of zero")
    operator.page.locator("#field-linear-x").fill("-0.1")
    operator.press("Publish")  # the second pull: the operator has looked
    operator.until_driven(operator.place, 0.05)
    assert operator.state["verdict"]["asked"][0] < 0.0
    times = operator.part("notices").locator(".notice-times", has_text=re.compile(r"\d"))
    # the page reports each of the three publishings once, not ten times a second
    assert all(int(re.sub(r"\D", "", text)) <= 3 for text in times.all_inner_texts())
    operator.page.evaluate("dispatchEvent(new Event('blur'))")
    operator.part("publish-running").get_by_text("/key_vel").wait_for(state="detached")
    operator.until_still()

    operator.page.locator("#field-linear-x").fill("0.1")
    operator.press("Publish")
    operator.until_driven(operator.place, 0.05)
    operator.page.get_by_role("tab", name="Motions").click()
    operator.until_still()
    operator.release()


def test_staff_call_services_and_set_parameters_on_the_list(person: Arrive) -> None:
    staff = person("staff", width=360, height=640)
    staff.take(ROBOT)
    topics_of(staff)
    services = staff.part("service-list")
    services.get_by_role("searchbox").fill("list_motions")
    services.get_by_role("button", name="/play_motion/list_motions").click()
    called = staff.part("service-call")
    called.get_by_text("play_motion_msgs/ListMotions", exact=True).wait_for()
    called.get_by_role("button", name="Call").click()
    called.get_by_text('"name": "wave"').wait_for()

    parameters = staff.part("parameter-list")
    parameters.get_by_role("searchbox").fill("/robot_description")
    parameters.get_by_role("button", name="/robot_description").first.click()
    shown = staff.part("parameter-value")
    shown.get_by_label("Value of /robot_description").fill('"no arm"')
    shown.get_by_role("button", name="Set").click()
    shown.get_by_text("not on the allow-list").wait_for()
    staff.release()
    assert staff.complaints == []
