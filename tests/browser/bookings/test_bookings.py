"""Bookings in a real browser with all real processes: drag, form, refusals, and a slot that ends while driving."""

from __future__ import annotations

import asyncio
import re
import sqlite3
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path
from uuid import uuid4

import pytest
from playwright.sync_api import expect

from robots.shared import wire
from script.stack.client import Driver, sign_in
from script.stack.stack import Stack
from tests.browser.people import Person, robot_side
from tests.browser.test_pages import found_by_axe

Arrive = Callable[..., Person]
ROBOT = "tiago-2"
NO_POLL = """const real = setInterval;
window.setInterval = (step, ms, ...others) => ms === 30000 ? 0 : real(step, ms, ...others);"""
POST_JSON = """async ([url, fields]) => {
  const token = document.querySelector("input[name=csrfmiddlewaretoken]").value;
  const headers = { Accept: "application/json", "X-CSRFToken": token };
  return (await fetch(url, { method: "POST", headers, body: new URLSearchParams(fields) })).status;
}"""


@pytest.fixture
def book(stack: Stack):
    """`book("operator", -60, 8)`: store a slot of any length, by seconds from now. The test's end deletes all slots."""
    with sqlite3.connect(stack.directory / "fleet.sqlite3", timeout=20) as database:

        def one(column: str, table: str, name: str) -> str:
            [found] = database.execute(f"SELECT id FROM {table} WHERE {column} = ?", [name]).fetchone()
            return str(found)

        def store(username: str, starts_s: float, ends_s: float) -> None:
            now = datetime.now(UTC).replace(tzinfo=None)
            starts, ends = (str(now + timedelta(seconds=seconds)) for seconds in (starts_s, ends_s))
            values = (
                uuid4().hex,
                one("slug", "robots_robot", ROBOT),
                one("username", "accounts_user", username),
            )
            database.execute(
                "INSERT INTO bookings_booking (id, robot_id, person_id, starts_at, ends_at, held_until, made_at,"
                " state, purpose, version) VALUES (?, ?, ?, ?, ?, ?, ?, 'booked', '', 1)",
                [*values, starts, ends, ends, starts],
            )
            database.commit()

        def free() -> None:
            database.execute("DELETE FROM bookings_booking")
            database.commit()

        def end_in(seconds: float) -> None:
            """End all slots that have begun this number of seconds from now, as if they had been booked so."""
            ends = str(datetime.now(UTC).replace(tzinfo=None) + timedelta(seconds=seconds))
            changed = "UPDATE bookings_booking SET ends_at = ?, held_until = ? WHERE starts_at < ?"
            database.execute(changed, [ends, ends, ends])
            database.commit()

        store.free, store.end_in = free, end_in
        yield store
        free()


def test_the_slot_ends_while_the_stick_is_held(person: Arrive, stack: Stack, book, tmp_path: Path) -> None:
    operator, supervisor = person("operator"), person("supervisor")
    said = tmp_path / "twists"
    with robot_side(stack.robots[ROBOT], "twists", said):
        operator.until(lambda: "listening" in said.read_text(), "the observer to listen")
        book("operator", -60, 900)
        operator.take(ROBOT)
        book.end_in(9)
        book("supervisor", 9, 900)
        start = operator.place
        operator.push("s", until=lambda: operator.control["state"] != "yours", what="the slot to end")
        assert operator.place != start
        operator.until_still()
        with ThreadPoolExecutor() as another_thread:  # Playwright uses the event loop of this thread
            refused = another_thread.submit(asyncio.run, insist(stack)).result()
    assert refused == {"take": "booked", "drive": "no_lease"}
    twists = [float(line) for line in said.read_text().split() if line != "listening"]
    driven = [number for number, vx in enumerate(twists) if vx]
    assert driven and not any(twists[driven[-1] + 1 :])  # the robot got nothing from `insist`
    assert twists[-1] == 0.0
    expect(operator.part("why")).to_contain_text("has booked this robot")
    expect(operator.part("slot")).to_contain_text("has a slot")
    supervisor.take(ROBOT)  # the supervisor has the next slot
    supervisor.release()


async def insist(stack: Stack) -> dict[str, str]:
    """Ask for control as the operator in another person's slot, and drive without it. Return the refusals."""
    async with Driver(stack, ROBOT, sign_in(stack, "operator")) as driver:
        await driver.send(wire.Take())
        await driver.drive(-1.0, 0.0)
        await driver.until(lambda: {one.of for one in driver.refused} >= {"take", "drive"}, 30.0)
        return {one.of: one.refusal.code for one in driver.refused}


def test_a_slot_is_booked_by_drag_and_by_form(person: Arrive, stack: Stack, book) -> None:
    operator, staff = person("operator"), person("staff")
    calendar_of_tomorrow(operator)
    expect(operator.page.locator(".ec-event")).to_have_count(0)
    drag(operator)
    expect(operator.part("dialog-title")).to_have_text("Book this slot?")
    operator.page.get_by_label("Purpose").fill("Exercise 7")
    assert found_by_axe(operator) == []
    operator.part("dialog-yes").click()
    expect(operator.part("refusals")).to_have_text("")  # if the test fails here, the reason is shown
    expect(operator.part("dialog")).to_be_hidden()
    expect(operator.page.locator(".ec-event.mine")).to_have_count(1)
    with sqlite3.connect(stack.directory / "fleet.sqlite3", timeout=20) as database:
        query = "SELECT count(*) FROM bookings_booking WHERE purpose = 'Exercise 7'"
        assert database.execute(query).fetchone() == (1,)

    staff.open("/bookings/new/")
    tomorrow = datetime.now(UTC) + timedelta(days=1)
    staff.page.locator("select[name='robot']").select_option("tiago-1")
    staff.page.get_by_label("From").fill(tomorrow.strftime("%Y-%m-%dT00:00"))
    staff.page.get_by_label("To", exact=True).fill(tomorrow.strftime("%Y-%m-%dT23:00"))
    staff.page.get_by_role("button", name="Book", exact=True).click()
    refusals = staff.page.locator(".refusals li")
    expect(refusals).to_have_count(2)  # the slot is taken, and it is too long
    expect(staff.page.locator(".alternatives a").first).to_contain_text("TIAGo One")


def test_a_booking_is_moved_and_lengthened_by_drag(person: Arrive, stack: Stack, book) -> None:
    operator, staff = person("operator"), person("staff")

    def held() -> tuple[datetime, datetime]:
        """Return the times of the operator's only booking."""
        with sqlite3.connect(stack.directory / "fleet.sqlite3", timeout=20) as database:
            query = (
                "SELECT starts_at, ends_at FROM bookings_booking b JOIN accounts_user u ON u.id = person_id"
            )
            [times] = database.execute(f"{query} WHERE username = 'operator'").fetchall()
        starts, ends = map(datetime.fromisoformat, times)
        return starts, ends

    def pull(place: tuple[float, float], down_px: float, then: Callable[[], object]) -> None:
        """Press there, drag down, and wait until the console has answered."""
        x, y = place
        operator.page.mouse.move(x, y)
        operator.page.mouse.down()
        operator.page.mouse.move(x, y + down_px, steps=8)
        with operator.page.expect_response("**/bookings/*/"):
            operator.page.mouse.up()
        operator.until(then, "the booking to change")

    calendar_of_tomorrow(operator)
    drag(operator)
    operator.part("dialog-yes").click()
    mine = operator.page.locator(".ec-event.mine")
    expect(mine).to_have_count(1)
    starts, ends = held()
    expect(operator.part("calendar")).to_have_attribute("aria-busy", "false")
    operator.until(mine.bounding_box, "the booking to be drawn")  # the calendar may be drawing it again
    box = mine.bounding_box()
    assert box
    hour_px = box["height"] / ((ends - starts) / timedelta(hours=1))

    def place(edge_px: float | None = None) -> tuple[float, float]:
        """Return the middle of the booking, or the point `edge_px` above its lower edge."""
        expect(operator.part("calendar")).to_have_attribute("aria-busy", "false")
        box = mine.bounding_box()
        assert box
        above_px = box["height"] / 2 if edge_px is None else edge_px
        return box["x"] + box["width"] / 2, box["y"] + box["height"] - above_px

    hour = timedelta(hours=1)
    pull(place(), hour_px, lambda: held() == (starts + hour, ends + hour))
    pull(place(edge_px=3), hour_px, lambda: held() == (starts + hour, ends + 2 * hour))

    staff.open("/bookings/new/")
    after = {"starts_at": f"{ends + 2 * hour:%Y-%m-%dT%H:%M}", "ends_at": f"{ends + 3 * hour:%Y-%m-%dT%H:%M}"}
    assert staff.page.evaluate(POST_JSON, ["/bookings/new/", {"robot": "tiago-1", **after}]) == 200
    expect(operator.page.locator(".ec-event.other")).to_have_count(1)
    pull(place(), hour_px, lambda: operator.part("dialog-title").text_content() == "Not changed")
    expect(operator.part("refusals")).to_contain_text("has booked TIAGo One")
    assert held() == (starts + hour, ends + 2 * hour)
    assert found_by_axe(operator) == []
    operator.part("alternatives").get_by_role("button").first.click()
    operator.until(lambda: held()[0] == ends + 3 * hour, "the same booking to move there")
    expect(operator.part("dialog")).to_be_hidden()


def test_the_booking_of_another_person_appears_at_once(person: Arrive, book) -> None:
    operator, staff = person("operator", apart=True), person("staff")
    operator.page.add_init_script(NO_POLL)  # without polling, only the console's events show the booking
    tomorrow = f"{datetime.now(UTC) + timedelta(days=1):%Y-%m-%d}"
    operator.open(f"/bookings/?day={tomorrow}")
    expect(operator.part("calendar").get_by_text("TIAGo One")).to_be_visible()
    event, listed = operator.page.locator(".ec-event"), operator.page.locator("#day li a")
    expect(event.or_(listed)).to_have_count(0)
    staff.open("/bookings/new/")
    slot = {"robot": "tiago-1", "starts_at": f"{tomorrow}T12:00", "ends_at": f"{tomorrow}T13:00"}
    assert staff.page.evaluate(POST_JSON, ["/bookings/new/", slot]) == 200
    expect(event).to_have_count(1)
    expect(listed).to_have_count(1)


def test_a_drag_before_the_robots_are_known_leads_to_the_form(person: Arrive) -> None:
    operator = person("operator", apart=True)
    operator.page.route("**/bookings/feed/**", lambda route: route.abort())
    operator.open("/bookings/")
    expect(operator.part("hint")).to_have_text("The bookings cannot be read now.")
    drag(operator)
    expect(operator.page).to_have_url(re.compile(r"/bookings/new/\?from=.+&to=.+"))
    expect(operator.page.get_by_label("From")).not_to_have_value("")


def drag(somebody: Person) -> None:
    """Drag over an hour and a half of the first robot."""
    x, y = drag_place(somebody)
    somebody.page.mouse.move(x, y)
    somebody.page.mouse.down()
    somebody.page.mouse.move(x, y + 44, steps=8)
    somebody.page.mouse.up()


def calendar_of_tomorrow(somebody: Person) -> None:
    """Open the calendar's next day, and wait until its robots and bookings are there."""
    tomorrow = datetime.now(UTC) + timedelta(days=1)
    somebody.open("/bookings/")
    with somebody.page.expect_response(f"**/bookings/feed/?start={tomorrow:%Y-%m-%d}&**"):
        somebody.page.get_by_role("button", name="Later", exact=True).click()
    expect(somebody.part("calendar")).to_have_attribute("aria-busy", "false")
    expect(somebody.part("calendar").get_by_text("TIAGo One")).to_be_visible()


def drag_place(somebody: Person) -> tuple[float, float]:
    """Return a place in the first robot's column, on a full line of the grid."""
    body = somebody.page.locator(".ec-body, .ec-main").first.bounding_box()
    assert body
    return body["x"] + 140, body["y"] + body["height"] / 2


def test_a_supervisor_takes_over_and_an_unused_slot_is_free(person: Arrive, stack: Stack, book) -> None:
    operator, supervisor = person("operator"), person("supervisor")
    book("staff", -60, 900)
    operator.watch(ROBOT)
    expect(operator.part("why")).to_contain_text("Staff has booked this robot")
    expect(operator.page.get_by_role("button", name="Take control")).to_be_hidden()
    supervisor.watch(ROBOT)
    supervisor.press("Take over…")
    supervisor.page.get_by_label("Reason").fill("fire drill")
    supervisor.page.keyboard.press("Enter")
    supervisor.until_in_control()
    supervisor.release()

    book.free()
    book("staff", -16 * 60, 900)  # not used within the grace time of 15 minutes
    operator.take(ROBOT)
    operator.release()


@pytest.mark.parametrize(("width", "height", "hours"), [(390, 844, 6), (844, 390, 3)])
def test_a_phone_shows_the_hours_of_the_day_first(
    person: Arrive, width: int, height: int, hours: int
) -> None:
    operator = person("operator", width=width, height=height, touch=True)
    operator.open("/bookings/")
    expect(operator.part("calendar").get_by_text("TIAGo One")).to_be_visible()
    for notice in operator.page.get_by_role("button", name="Seen").all():  # of the tests before
        notice.click()
    expect(operator.page.get_by_role("button", name="Seen")).to_have_count(0)
    expect(operator.page.locator(".ec-now-indicator").first).to_be_in_viewport()
    seen = operator.page.evaluate(
        """() => {
          const box = (name) => document.querySelector(name).getBoundingClientRect();
          const below = [box(".ec-main").bottom, box(".dock").top, innerHeight].filter((edge) => edge > 0);
          return Math.min(...below) - box(".ec-col-head").bottom;
        }"""
    )
    hour_px = operator.page.evaluate(
        "() => document.querySelector('.ec-body').getBoundingClientRect().height / 24"
    )
    assert seen / hour_px >= hours
    assert operator.page.evaluate("() => document.documentElement.scrollWidth") == width
