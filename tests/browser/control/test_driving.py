"""Driving in a real browser with all real processes: sign in, take control, drive up to the gate's limit, stop."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import WebSocketRoute, expect

from script.stack.stack import Stack
from tests.browser.conftest import AT_THE_WALL, PutBack
from tests.browser.people import Fingers, Person

Arrive = Callable[..., Person]


def test_a_finger_drives_to_the_wall_and_a_second_finger_stops(person: Arrive, tiago_two: PutBack) -> None:
    tiago_two(AT_THE_WALL)
    operator = person("operator", width=390, height=844, touch=True)
    operator.take("tiago-2")
    fingers = Fingers(operator)
    start = operator.place
    x, y = operator.middle_of("zone")

    fingers.put(1, (x, y))
    ahead, back = (x, y - operator.stick_reach), (x, y + operator.stick_reach)
    fingers.push(1, ahead, lambda: math.dist(operator.place, start) > 0.3, "0.3 m by odometry")
    assert operator.last_drive == (1, 0, 0)

    def held() -> bool:
        asked, allowed = (operator.state["verdict"][name][0] for name in ("asked", "allowed"))
        return asked > 0 and allowed == 0 and abs(operator.state["odometry"]["vx"]) < 0.02

    fingers.push(1, ahead, held, "the gate to hold at the wall")
    assert 0 < operator.state["verdict"]["distance_m"] < 0.5  # before the wall, not in the wall
    says = re.compile(r"Something (is|was seen earlier,) 0\.\d m ahead")
    fingers.push(
        1, ahead, lambda: says.fullmatch(operator.part("reason-title").inner_text()), "words on the wall"
    )

    # The same finger takes the way out. A button that has just come takes no press: it may be meant for another.
    fingers.lift(1)
    wall = operator.place
    operator.part("reason-act").wait_for()
    operator.page.wait_for_timeout(500)
    fingers.tap(operator.middle_of("reason-act"))
    operator.until(lambda: math.dist(operator.place, wall) > 0.2, "0.2 m back from the wall")
    operator.until(lambda: operator.state["drive_by"] is None, "the end of the way out")
    fingers.put(1, (x, y))

    # The robot drives back; then stop, with the first finger still on the stick.
    fingers.push(1, back, lambda: operator.state["odometry"]["vx"] < -0.05, "reverse")
    expect(operator.part("reasons-now")).to_contain_text("Reversing")
    fingers.put(2, operator.middle_of("stop"))
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "confirmed standstill")
    operator.until_still()
    assert operator.last_drive == (0, 0, 0)
    standstill_ms = operator.state["stop"]["standstill_ms"]
    expect(operator.part("stop-state")).to_contain_text(f"{standstill_ms:.0f}\u00a0ms")
    assert operator.sent.count("stop") == 1

    # The first finger is still down. It does not drive, also after the clear.
    fingers.lift(2)
    operator.clear()
    operator.part("reason").get_by_text("Let the stick return to the middle").wait_for()
    fingers.move(1, (x, y + 0.8 * operator.stick_reach))
    sent = len(operator.drives)
    operator.until(lambda: len(operator.drives) > sent + 1, "the stick's place sent twice after that")
    assert operator.last_drive == (0, 0, 0)
    fingers.lift(1)
    operator.release()
    assert operator.complaints == []


def test_control_is_asked_for_handed_over_and_taken_over(person: Arrive) -> None:
    operator, supervisor, staff = person("operator"), person("supervisor"), person("staff")
    operator.take("tiago-2")
    supervisor.watch("tiago-2")
    expect(supervisor.part("who")).to_have_text("Operator has control")

    supervisor.press("Ask for control")
    operator.press("Hand over to Supervisor")
    supervisor.until_in_control()
    operator.until(lambda: operator.control["state"] == "other", "control to be gone")
    expect(operator.part("who")).to_have_text("Supervisor has control")
    supervisor.drive("w", metres=0.1)
    supervisor.let_go("w")

    staff.watch("tiago-2")
    staff.press("Take over…")
    staff.page.get_by_role("textbox", name="Reason", exact=True).fill("the door must be kept free")
    staff.page.keyboard.press("Enter")
    staff.until(lambda: staff.control["state"] == "yours", "control to be taken over")
    supervisor.part("notices").get_by_text("the door must be kept free").wait_for()
    staff.release()


def test_a_released_robot_is_offered_to_the_next_in_line(person: Arrive) -> None:
    operator, supervisor = person("operator"), person("supervisor")
    operator.take("tiago-2")
    supervisor.watch("tiago-2")
    supervisor.press("Ask for control")
    expect(supervisor.part("why")).to_have_text("You are the next in line.")
    operator.release()
    expect(supervisor.part("who")).to_have_text("It is your turn")  # the offer lasts 30 s
    expect(supervisor.part("why")).to_contain_text(re.compile(r"Take control within (30|2\d) s"))
    expect(operator.part("why")).to_contain_text("Supervisor is next in line")
    expect(operator.page.get_by_role("button", name="Take control")).to_be_hidden()
    operator.press("Ask for control")
    supervisor.press("Take control")
    supervisor.until_in_control()
    expect(operator.part("why")).to_have_text("You are the next in line.")
    supervisor.press("Hand over to Operator")
    operator.until_in_control()
    operator.release()


def test_keys_drive_space_is_the_holders_and_all_may_stop(person: Arrive) -> None:
    operator, observer = person("operator"), person("observer")
    operator.take("tiago-2")
    observer.watch("tiago-2")
    observer.page.keyboard.press("Space")
    observer.page.keyboard.press("w")

    operator.drive("ArrowUp", metres=0.1)
    assert operator.state["stop"]["state"] == "clear"
    assert observer.drives == []
    operator.page.keyboard.press("Space")
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "the stop")
    operator.page.keyboard.up("ArrowUp")
    observer.until(lambda: observer.state["stop"]["state"] == "stopped", "the stop, for those who watch")
    expect(observer.part("reason-title")).to_have_text("Stopped by Operator")
    assert not observer.part("reason-act").is_visible()
    operator.clear()

    operator.drive("w", metres=0.1)
    observer.page.get_by_role("button", name="Stop").click()
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "the stop")
    assert operator.last_drive == (0, 0, 0)
    operator.page.keyboard.up("w")
    operator.clear()

    # On tabs without joystick, letters and arrows do not drive; space still stops.
    operator.page.evaluate("location.hash = 'topics'")
    operator.page.locator(".control[data-tab=topics]").wait_for()
    operator.drives.clear()
    operator.page.keyboard.down("ArrowUp")
    operator.page.keyboard.down("w")
    operator.until(lambda: len(operator.drives) > 5, "the stick")
    assert {(drive["x"], drive["w"]) for drive in operator.drives} == {(0, 0)}
    operator.page.keyboard.up("w")
    operator.page.keyboard.up("ArrowUp")
    operator.page.keyboard.press("Space")
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "the stop")
    operator.clear()
    operator.release()


@pytest.mark.parametrize(
    "happening",
    [
        "window.dispatchEvent(new Event('blur'))",
        "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
        "document.dispatchEvent(new Event('visibilitychange'))",
    ],
    ids=["blurred", "hidden"],
)
def test_zero_goes_out_at_once_when_the_page_is_left(person: Arrive, happening: str) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    operator.drag_stick(1, 0)
    operator.until(lambda: operator.drives and operator.last_drive == (0, 0, -1), "a turn to the right")
    operator.page.evaluate(happening)
    operator.move_stick(1, -0.03)
    operator.until(lambda: operator.last_drive == (0, 0, 0), "zero")
    operator.page.wait_for_timeout(250)
    assert operator.last_drive == (0, 0, 0)
    operator.until_still()
    operator.page.mouse.up()
    operator.release()


def test_changing_the_input_means_zero_until_both_have_rested(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    keyboard = operator.page.keyboard
    operator.drag_stick(-1, 0)
    operator.until(lambda: operator.drives and operator.last_drive == (0, 0, 1), "a turn to the left")
    keyboard.down("d")
    operator.until(lambda: operator.last_drive == (0, 0, 0), "zero")
    operator.page.mouse.up()
    keyboard.up("d")
    keyboard.down("d")
    operator.until(lambda: operator.last_drive == (0, 0, -1), "a turn to the right")
    keyboard.up("d")
    operator.release()


def test_a_sticky_stick_stays_and_ends_with_any_other_input(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    operator.press("Stick stays")
    operator.drag_stick(1, 0)
    operator.page.mouse.up()
    operator.until(lambda: operator.drives and operator.last_drive == (0, 0, -1), "a turn to the right")
    operator.page.wait_for_timeout(400)
    assert operator.last_drive == (0, 0, -1)
    operator.page.keyboard.press("w")
    operator.until(lambda: operator.last_drive == (0, 0, 0), "zero")
    operator.release()


def test_a_sticky_stick_ends_where_the_gate_holds_the_robot(person: Arrive, tiago_two: PutBack) -> None:
    tiago_two(AT_THE_WALL)
    operator = person("operator")
    operator.take("tiago-2")
    operator.press("Stick stays")
    operator.drag_stick(0, 1)
    operator.page.mouse.up()
    operator.until(lambda: operator.state["verdict"]["asked"][0] > 0, "the stick to stay")
    operator.until(lambda: operator.last_drive == (0, 0, 0), "the stick to let go at the wall", timeout_s=40)
    operator.until_still()
    operator.release()


def test_a_reload_keeps_control_and_the_robot_stands_meanwhile(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    fence = operator.control["fence"]
    operator.push("a", until=lambda: operator.state["odometry"]["w"] > 0.1, what="a turn to the left")
    operator.let_go("a")
    operator.watch("tiago-2")
    operator.until_in_control()
    assert operator.control["fence"] == fence
    operator.push("a", until=lambda: operator.state["odometry"]["w"] > 0.1, what="a turn to the left again")
    operator.let_go("a")
    operator.release()


def test_a_duplicated_tab_is_a_tab_of_its_own(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    token = "sessionStorage.getItem('tab-token')"
    held = operator.page.evaluate(token)
    copy = operator.context.new_page()
    copy.add_init_script(
        f"sessionStorage.getItem('tab-token') ?? sessionStorage.setItem('tab-token', '{held}')"
    )
    copy.goto(operator.page.url)
    copy.get_by_text("You have control in another tab").wait_for()
    assert copy.evaluate(token) != held
    assert operator.control["state"] == "yours"
    copy.close()
    operator.release()


def test_a_gamepad_drives_and_its_button_stops(person: Arrive) -> None:
    operator = person("operator", apart=True)
    operator.page.add_init_script(
        "window.pad = {index: 1, id: 'pad', mapping: 'standard', connected: true, axes: [0, 0, 0, 0],"
        " buttons: [{}, {pressed: false}]};"
        "window.odd = {index: 0, id: 'sensor', mapping: '', connected: true, axes: [0.7, -0.4], buttons: []};"
        "navigator.getGamepads = () => [window.odd, window.pad];"
    )
    operator.take("tiago-2")
    operator.page.evaluate("pad.axes = [0, 0, 1, 0]")
    operator.until(lambda: operator.drives and operator.last_drive == (0, 0, -1), "a turn to the right")
    operator.page.evaluate("pad.axes = [0.1, 0.1, 0.1, 0]")
    operator.until(lambda: operator.last_drive == (0, 0, 0), "a resting pad that drifts a little")
    operator.page.evaluate("pad.buttons[1].pressed = true")
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "the stop")
    operator.clear()
    operator.release()


def test_a_drive_by_a_distance_is_shown_cancelled_and_replaced(person: Arrive) -> None:
    operator = person("operator", apart=True)
    operator.page.add_init_script(
        "window.WebSocket = class extends WebSocket"
        " { constructor(...where) { super(...where);"
        r" if (/\/robots\/[^/]+\/$/.test(where[0])) window.socket = this; } };"
    )
    operator.take("tiago-2")

    def turn(seq: int) -> None:
        order = {"t": "drive_by", "fence": operator.control["fence"], "seq": seq, "angle_rad": 6.0}
        operator.page.evaluate("(order) => socket.send(JSON.stringify(order))", order)
        operator.until(lambda: operator.state["drive_by"] is not None, "the turn")

    def outcome(seq: int) -> str | None:
        end = operator.state["drive_by_ended"]
        return end["outcome"] if end and end["seq"] == seq else None

    turn(900_001)
    expect(operator.part("drive_by-words")).to_contain_text("of 344°")
    expect(operator.part("drive_by-who")).to_have_text("for Operator")
    operator.until(lambda: operator.state["odometry"]["w"] > 0.2, "a turn to the left")
    operator.part("drive_by-cancel").click()
    operator.until(lambda: outcome(900_001) == "cancelled", "its end")
    operator.until_still()

    turn(900_002)
    operator.page.keyboard.down("d")
    operator.until(lambda: outcome(900_002) == "replaced", "the key to take over")
    operator.until(lambda: operator.state["odometry"]["w"] < -0.1, "a turn to the right")
    operator.page.keyboard.up("d")
    operator.until_still()
    expect(operator.part("drive_by-runs")).to_be_hidden()
    assert operator.state["neutral_needed"] is None
    operator.release()


def test_a_press_on_the_plan_drives_there(person: Arrive) -> None:
    operator = person("operator", apart=True)
    operator.take("tiago-2")
    operator.fold_arm()
    operator.until(lambda: drives_there(operator), "a drive to a point of the plan")
    expect(operator.part("there-offer")).to_be_hidden()
    operator.release()


def drives_there(operator: Person) -> bool:
    """Press free floor, then the button. Return False if the drive ended early: a busy computer's data come late."""
    box = operator.part("picture").bounding_box()
    assert box is not None
    offer, go = operator.part("there-offer"), operator.part("there-go")
    for left, ahead in ((50, 60), (-50, 60), (50, -60), (-50, -60)):  # pixels; one of them is free floor
        operator.page.mouse.click(box["x"] + box["width"] / 2 - left, box["y"] + 0.6 * box["height"] - ahead)
        expect(offer).to_be_visible()
        if offer.get_attribute("data-problem") is None:
            break
    words = re.fullmatch(r"([\d.]+) m away", operator.part("there-words").inner_text())
    assert words is not None
    start, yaw = operator.place, operator.state["odometry"]["yaw"]
    last = (operator.state["drive_by_ended"] or {"number": 0})["number"]

    def is_over() -> bool:
        if go.is_visible():
            go.click()  # it ignores the second tap of a double tap
        end = operator.state["drive_by_ended"]
        if end is None or end["number"] == last:
            return False
        return end["outcome"] != "done" or end["distance_m"] > 0.3  # the turn is the first of two drives

    operator.until(is_over, "the end of the drive")
    if operator.state["drive_by_ended"]["outcome"] != "done":
        return False
    assert math.dist(operator.place, start) == pytest.approx(float(words[1]), abs=0.1)
    turned = operator.state["odometry"]["yaw"] - yaw - math.atan2(left, ahead)
    assert math.cos(turned) > 0.99
    return True


def test_space_stops_for_the_holder_while_the_connection_is_lost(person: Arrive) -> None:
    operator, observer = person("operator", apart=True), person("observer")
    sockets: list[WebSocketRoute] = []
    lost = False

    def route(socket: WebSocketRoute) -> None:
        if lost:
            socket.close()
        else:
            socket.connect_to_server()
            sockets.append(socket)

    operator.page.route_web_socket("**/ws/**", route)
    operator.take("tiago-2")
    observer.watch("tiago-2")
    lost = True
    for socket in sockets:
        socket.close()
    operator.part("reason-title").get_by_text("No connection").wait_for()
    operator.page.keyboard.press("Space")
    observer.until(lambda: observer.state["stop"]["state"] == "stopped", "the stop")
    assert observer.state["stop"]["by"] == "Operator"
    lost = False
    operator.watch("tiago-2")  # within the 10 s for which control is kept
    operator.clear()
    operator.release()


def test_the_stop_goes_another_way_without_a_live_link(person: Arrive) -> None:
    """Without a connection, and with one that swallows everything."""
    operator, observer = person("operator"), person("observer", apart=True)
    operator.take("tiago-2")
    observer.page.route_web_socket("**/ws/**", lambda socket: socket.close())
    observer.open("/robots/tiago-2/")
    observer.part("reason-title").get_by_text("No connection").wait_for()
    observer.page.get_by_role("button", name="Stop").click()
    operator.until(lambda: operator.state["stop"]["state"] == "stopped", "the stop")
    assert operator.state["stop"]["by"] == "Observer"
    operator.clear()

    pages: list[tuple[Person, list[WebSocketRoute]]] = []
    for path, button, region in (
        ("/robots/tiago-2/", "Stop", "stop-state"),
        ("/", "Stop TIAGo Two", "stop-state"),
        ("/", "Stop all", "stop-all-state"),
    ):
        observer = person("observer", apart=True)
        silent = swallowed(observer)
        pages.append((observer, silent))
        observer.open(path)
        observer.until(lambda silent=silent: silent, "a socket")
        observer.page.get_by_role("button", name=button, exact=True).click()
        operator.until(lambda: operator.state["stop"]["state"] == "stopped", f"the stop: {button}")
        assert operator.state["stop"]["by"] == "Observer"
        observer.part(region).get_by_text("Stopped.").last.wait_for()
        operator.clear()
    for observer, silent in pages:  # after 4 s, at the same time for all pages
        observer.until(lambda silent=silent: len(silent) > 1, "the page to give the silent socket up")
    operator.release()


def swallowed(person: Person) -> list[WebSocketRoute]:
    """Return the sockets that the page opens after this call, but for its news: they open, but transfer nothing."""
    silent: list[WebSocketRoute] = []
    person.page.route_web_socket(re.compile("/ws/(?!news/)"), lambda socket: silent.append(socket))
    return silent


@pytest.mark.usefixtures("tiago_one")
def test_stop_all_stops_every_robot_from_the_fleet_page(person: Arrive, stack: Stack) -> None:
    staff = person("staff")
    staff.open("/")
    staff.until(lambda: "fleet" in staff.heard, "the cards")

    def all_robots(are: Callable[[dict[str, Any]], bool]) -> bool:
        cards = staff.heard["fleet"]["robots"].values()
        return all(card["state"] and are(card["state"]) for card in cards)

    staff.until(lambda: all_robots(lambda state: bool(state["stands"])), "every robot to stand, by odometry")
    staff.press("Stop all")
    staff.until(
        lambda: all_robots(lambda state: state["stop"]["state"] == "stopped"), "every robot to be stopped"
    )
    # On a busy computer the page also posts the stop. Wait for its answer: the stop must not come after the clear.
    expect(staff.part("stop-all-state")).to_have_text("Stopped.")
    expect(staff.page.locator(".robot[data-stopped]")).to_have_count(len(stack.robots))
    expect(staff.page.locator("[data-part=stop-why]").first).to_contain_text(
        re.compile("was standing|Standstill confirmed")
    )

    # By keyboard: list all stops and clear them.
    staff.part("clear-all").focus()
    staff.page.keyboard.press("Enter")
    rows = staff.page.get_by_role("dialog", name="Clear the stops?").get_by_role("listitem")
    expect(rows).to_have_count(len(stack.robots))
    expect(rows.first).to_contain_text("Stopped by Staff.")
    staff.page.get_by_role("button", name="Clear all", exact=True).focus()
    staff.page.keyboard.press("Enter")
    expect(rows.get_by_text("Cleared.")).to_have_count(len(stack.robots))
    staff.page.keyboard.press("Escape")
    expect(staff.page.locator(".robot[data-stopped]")).to_have_count(0)
    expect(staff.part("clear-all")).to_be_hidden()
