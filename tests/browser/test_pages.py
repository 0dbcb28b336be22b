"""Layout of pages: everything is visible, axe-core has no complaints, CSP blocks nothing."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from urllib.parse import urlsplit
from uuid import uuid4

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.people import MADE_UP_LANGUAGE, Person
from tests.script.support import manage

Arrive = Callable[..., Person]

AXE = Path(__file__).resolve().parents[2] / "node_modules/axe-core/axe.min.js"
PAGES = [
    "/bookings/",
    "/bookings/new/",
    "/bookings/mine/",
    "/bookings/devices/",
    "/bookings/policies/",
    "/bookings/policies/all/",
    "/bookings/series/",
    "/bookings/report/",
    "/bookings/holidays/",
    "/courses/",
    "/courses/new/",
    "/robot-groups/",
    "/qualifications/",
    "/sign-in-rules/",
    "/webhooks/",
    "/webhooks/new/",
    "/mail/",
    "/status/",
    "/status/rules/",
    "/access/",
    "/tokens/",
    "/service-accounts/",
    "/",
    "/plan/",
    "/robots/tiago-2/",
    "/robots/tiago-2/check/",
    "/accounts/",
    "/accounts/email/",
    "/accounts/second-factor/",
    "/accounts/password/forgotten/",
    "/accounts/sessions/",
    "/accounts/password/",
    "/accounts/sign-in/",
    "/admin/",
    "/admin/robots/robot/add/",
    "/admin/robots/robotrole/add/",
    "/admin/robots/bridgehost/",
    "/admin/robots/bridgehost/add/",
    "/admin/robots/phrase/",
    "/admin/robots/phrase/import/",
    "/robots/tiago-2/report/",
    "/your-data/",
    "/about/",
    "/privacy/",
    "/admin/audit/record/",
    "/admin/audit/speechrecord/",
    "/admin/teleop/controlsession/",
    "/help/",
    "/help/operators/",
    "/?wall",
    "/setup/robot/",
    "/setup/robot/tiago-2/",
    "/setup/people/",
    "/offline/",
    "/nowhere/",
    "/api/v1/reference",
]
DAILY = {
    "/",
    "/bookings/",
    "/bookings/new/",
    "/robots/tiago-2/",
    "/accounts/",
    "/accounts/sign-in/",
    "/your-data/",
}
REFUSED = ["/setup/", "/join/nowhere/", "/welcome/nowhere/"]
SIZES = [(360, 640), (844, 390), (1440, 900)]
A_LONG_NAME = "Wilhelmina-Konstantinopoulou van den Bergh-Featherstonehaugh"


# Report violations only: a report of all results takes three times as long.
RUN_AXE = """async (rules) => {
  const runOnly = rules && { type: "rule", values: rules };
  const { violations } = await axe.run({ resultTypes: ["violations"], ...(runOnly && { runOnly }) });
  return violations.flatMap(({ id, nodes }) =>
    nodes.map(({ target, failureSummary }) => `${id}: ${JSON.stringify(target)} ${failureSummary}`));
}"""
OF_COLOURS = ["color-contrast"]  # the rules whose answer depends on the theme


def found_by_axe(person: Person, rules: list[str] | None = None) -> list[str]:
    """Return axe-core's complaints about the page, as lines; of all rules, or of these."""
    if not person.page.evaluate("'axe' in window"):
        person.page.evaluate(AXE.read_text())
    # The admin animates its colours: finish this. The other pages do not animate for these browsers.
    person.page.evaluate("document.getAnimations().map(one => one.finish())")
    found: list[str] = person.page.evaluate(RUN_AXE, rules)
    return found


def axe_accepts(person: Person, what: str) -> None:
    """Check the page with axe-core, and its colours in the dark too."""
    for theme, rules in (("dark", OF_COLOURS), ("light", None)):
        person.page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
        assert found_by_axe(person, rules) == [], (what, theme)


def axe_accepts_everywhere(person: Person, what: str) -> None:
    """Check the open page with axe-core at all sizes, and its colours in the dark too."""
    before = person.page.viewport_size
    assert before is not None
    axe_accepts(person, what)
    for width, height in SIZES:
        if (width, height) != (before["width"], before["height"]):
            person.page.set_viewport_size({"width": width, "height": height})
            assert found_by_axe(person) == [], (what, width)
    person.page.set_viewport_size(before)


@pytest.mark.parametrize("pleases_axe", ["daily", "all"])
def test_every_page_is_narrow_stays_local_and_pleases_axe(person: Arrive, pleases_axe: str) -> None:
    staff = person("staff", touch=True, apart=True)
    group = "from robots.access.models import RobotGroup as G; G.objects.get_or_create(name='TIAGos', slug='tiagos')"
    manage(staff.stack, "shell", "-v", "0", "-c", group)
    asked: list[str] = []
    complaints: list[str] = []
    news: dict[Page, list[str]] = {staff.page: [], staff.context.new_page(): []}
    tabs = list(news)
    staff.context.on("request", lambda request: asked.append(request.url))
    for tab in tabs:
        tab.on("websocket", lambda socket: asked.append(socket.url.replace("ws://", "http://")))
        tab.on("console", lambda line, tab=tab: news[tab].append(line.text) if line.type == "error" else None)
        tab.on("pageerror", lambda error, tab=tab: news[tab].append(str(error)))

    def open_in(tab: Page, path: str) -> None:
        news[tab].clear()  # axe-core itself breaks the policy for styles
        tab.set_viewport_size({"width": 1440, "height": 900})
        tab.goto(staff.stack.url + path)

    drawers = [f"/robots/tiago-2/#{name}" for name in ("drive", "motions", "speech", "topics")]
    paths = [*PAGES, *REFUSED, *drawers]
    open_in(tabs[0], paths[0])
    for number, path in enumerate(paths):
        staff.page = tab = tabs[number % 2]
        if pleases_axe == "all" or path in (*DAILY, *drawers):  # half a second without requests
            tab.wait_for_load_state("networkidle")
        missing = path in REFUSED or path == "/nowhere/"
        complaints += [line for line in news[tab] if not missing or "responded with a status" not in line]
        if number + 1 < len(paths):  # axe-core runs while the next page loads
            open_in(tabs[(number + 1) % 2], paths[number + 1])
        if path in DAILY or (pleases_axe == "all" and path not in drawers):
            axe_accepts(staff, path)
        tab.set_viewport_size({"width": 360, "height": 640})
        assert tab.evaluate("document.scrollingElement.scrollWidth") == 360, path
        assert not tab.locator("[data-pages]").is_visible(), (
            path
        )  # it would lie under the stop: the menu has it
    assert any("/ws/" in url for url in asked)
    assert [url for url in asked if not url.startswith(staff.stack.url)] == []
    assert complaints == []


def test_axe_accepts_a_course_its_booking_and_its_drive(person: Arrive) -> None:
    """Pages of one course, person, booking, day and control session; light and dark, on a phone and a desk screen."""
    operator, staff = person("operator"), person("staff")
    operator.take("tiago-2")
    operator.release()
    page, name, day = staff.page, f"Axe {uuid4().hex[:6]}", datetime.now(UTC) + timedelta(days=2)
    staff.open("/courses/new/")
    page.get_by_label("Name", exact=True).fill(name)
    page.get_by_label("Last day").fill(f"{day:%Y-%m-%d}")
    page.get_by_label("TIAGo Two").check()
    page.get_by_label("People", exact=True).fill(f"Ada <{name[4:]}@example.org>\nNobody")
    page.get_by_role("button", name="Make the course").click()
    page.get_by_role("button", name="Make the course with 1 person").first.click()
    course = urlsplit(page.url).path
    page.get_by_role("button", name="Make a link").click()
    invitation = urlsplit(page.url).path
    [join] = set(re.findall(r"/join/[^/]+/", page.content()))
    staff.open("/bookings/new/")
    page.get_by_label("From").fill(f"{day:%Y-%m-%dT09:00}")
    page.get_by_label("To", exact=True).fill(f"{day:%Y-%m-%dT09:30}")
    page.get_by_role("button", name="Book", exact=True).click()
    booking = page.locator(".booking-rows a[href^='/bookings/']").last.get_attribute("href")
    staff.open(course)
    someone = page.locator("a.why").first.get_attribute("href")
    staff.open("/robot-groups/")
    new = page.get_by_role("region", name="New group")
    new.get_by_label("Name").fill(f"Group {name}")
    new.get_by_role("button", name="Save").click()
    details = page.locator("details", has_text=f"Group {name}")
    group = details.locator("a[href*='/people/']").get_attribute("href")
    staff.open("/admin/robots/robot/")
    robot = page.get_by_role("link", name="TIAGo Two").get_attribute("href")
    staff.open("/today/")
    session = page.locator(".today-rows a[href^='/sessions/']").last.get_attribute("href")
    paths = [
        *(
            "/bookings/",
            "/bookings/new/",
            "/bookings/mine/",
            "/bookings/changes/",
            "/today/",
            booking,
            session,
            someone,
            invitation,
        ),
        *(course, f"{course}enrol/", f"{course}edit/", f"/bookings/courses{course.removeprefix('/courses')}"),
        *(group, robot, "/accounts/settings/", "/accounts/second-factor/totp/activate/", "/your-data/"),
    ]
    for path in paths:
        staff.open(str(path))
        assert "No such page" not in page.title(), path
        for width, height in (SIZES[0], SIZES[-1]):
            page.set_viewport_size({"width": width, "height": height})
            assert page.evaluate("document.scrollingElement.scrollWidth") == width, path
            axe_accepts(staff, f"{path}, {width} px")
    newcomer = person("operator", apart=True, width=360, height=640)
    newcomer.context.clear_cookies()
    newcomer.open(join)
    expect(newcomer.page.get_by_label("Your e-mail address or student number")).to_be_visible()
    axe_accepts(newcomer, "who are you")
    newcomer.page.get_by_role("link", name="I am not on the list").click()
    expect(newcomer.page.get_by_label("User name")).to_be_visible()
    axe_accepts(newcomer, "page")
    staff.open(course)
    page.get_by_role("button", name="Link to set a password").click()
    expect(page.locator(".slip-link")).to_be_visible()
    axe_accepts(staff, "links")
    staff.open(str(booking))
    page.get_by_role("button", name="Cancel this booking").click()
    staff.open(course)
    page.get_by_role("button", name="Archive").click()
    staff.open("/robot-groups/")
    details.locator("summary").click()
    details.get_by_role("button", name="Delete").click()


def test_axe_accepts_cards_of_silent_robots(person: Arrive) -> None:
    staff = person("staff", apart=True)
    staff.page.route_web_socket(re.compile("/ws/fleet/$"), lambda _silent: None)
    staff.open("/")
    expect(staff.page.locator(".robot[data-stale]").first).to_be_visible()
    axe_accepts(staff, "page")


def test_axe_accepts_open_parts_of_the_api_reference(person: Arrive) -> None:
    staff = person("staff", apart=True)
    staff.open("/api/v1/reference")
    page = staff.page
    for kind in (
        "post",
        "get",
    ):  # the page has only operations near the window: a POST below an open GET is not there
        page.locator(f".opblock-{kind} .opblock-summary-control").first.click()
        page.locator(f".opblock-{kind}.is-open .responses-inner").wait_for()
    page.locator(".is-open .try-out__btn").first.click()
    page.locator(".is-open .try-out__btn.cancel").wait_for()
    page.locator(".models-control").first.click()
    page.locator(".json-schema-2020-12-expand-deep-button").first.wait_for()
    axe_accepts(staff, "operations and models")
    page.locator(".btn.authorize").first.click()
    page.locator(".modal-ux").wait_for()
    axe_accepts(staff, "sign-in of programs")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_accepts_control_stopped_page_and_dialogs(person: Arrive, theme: str) -> None:
    staff = person("staff", theme=theme, width=360, height=640)
    staff.take("tiago-2")
    assert found_by_axe(staff) == []
    for drawer in ("Actions", "More"):
        staff.open_drawer(drawer)
        assert found_by_axe(staff) == [], drawer
    staff.press("Details")
    assert found_by_axe(staff) == []
    staff.page.keyboard.press("Escape")
    staff.page.get_by_role("button", name="Stop").click()
    staff.until(lambda: staff.state["stop"]["state"] == "stopped", "the stop")
    assert found_by_axe(staff) == []
    staff.press("Clear stop…")
    assert found_by_axe(staff) == []
    staff.page.get_by_role("dialog").get_by_role("button", name="Clear stop").click()
    staff.release()


@pytest.mark.parametrize(("width", "height"), [*SIZES, (1024, 768), (820, 1180), (1180, 820)])
def test_joystick_and_stop_are_visible_in_every_window(person: Arrive, width: int, height: int) -> None:
    operator = person("operator", width=width, height=height, touch=width < 1000)
    operator.take("tiago-2")
    everything_is_in_sight(operator, width, height)
    what_comes_by_itself_covers_no_button_of_the_picture(operator)
    stick, stop = places_of_stick_and_stop(operator)
    assert stick["x"] < stop["x"] or width < height
    operator.open_drawer("More")
    operator.press("Swap sides")
    operator.page.keyboard.press("Escape")
    assert operator.page.locator("[data-sides=swapped]").count() == 1
    everything_is_in_sight(operator, width, height)
    stick, stop = places_of_stick_and_stop(operator)
    assert stick["x"] > stop["x"] or width < height
    assert operator.part("zone").evaluate("zone => getComputedStyle(zone).touchAction") == "none"
    for language in ("longer", "mirrored"):
        operator.page.evaluate(MADE_UP_LANGUAGE, language)
        everything_is_in_sight(operator, width, height)
    stick, stop = places_of_stick_and_stop(operator)
    assert stick["x"] < stop["x"] or width < height
    operator.page.locator("[data-action=release]").click()
    operator.until(lambda: operator.control["state"] == "free", "control to be free")


def test_controls_fit_a_finger_and_do_not_jump(person: Arrive) -> None:
    operator, staff = person("operator", width=360, height=640, touch=True), person("staff")
    operator.watch("tiago-2")
    before = places_on_tabs(operator)
    operator.press("Take control")
    operator.until_in_control()
    assert places_on_tabs(operator) == before
    keep = operator.part("actions").get_by_role("button", name="More time")
    places = box_of(keep), places_on_tabs(operator)
    staff.watch("tiago-2")
    staff.press("Ask for control")
    hand_over = operator.page.get_by_role("button", name="Hand over to Staff")
    hand_over.wait_for()
    assert (box_of(keep), places_on_tabs(operator)) == places
    assert too_small(operator) == []
    operator.page.locator(".menu summary").click()
    assert too_small(operator) == []
    operator.page.locator(".menu summary").click()
    staff.press("Leave the line")
    operator.release()


def places_on_tabs(person: Person) -> list[dict[str, float]]:
    """Return the places of stick, speeds, stop, first motion and phrase; check that no control is too small."""
    places = []
    for tab, names in {
        "motions": [".motions .hit"],
        "speech": [".phrases .hit"],
        "centre": [".zone", ".openers", ".speed .segments"],
    }.items():
        person.page.evaluate("tab => { location.hash = tab }", tab)
        person.page.locator(f".control[data-tab={tab}]").wait_for()
        assert too_small(person) == [], tab
        for name in [*names, "form.stop .stop-button"]:
            places.append(box_of(person.page.locator(name).first))
    return places


SCROLL_SIDEWAYS = """() => [...document.querySelectorAll("*")]
  .filter((one) => one.checkVisibility() && /auto|scroll/.test(getComputedStyle(one).overflowX))
  .filter((one) => one.scrollWidth > one.clientWidth + 1)
  .map((one) => one.outerHTML.slice(0, 80))"""


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_picture_has_two_fifths_of_an_upright_phone(person: Arrive, theme: str) -> None:
    operator = person("operator", width=360, height=640, touch=True, theme=theme)
    operator.take("tiago-2")
    picture = box_of(operator.page.locator("[data-picture-area]"))  # the plan, the camera, or both
    assert picture["width"] * picture["height"] >= 0.4 * 360 * 640
    for drawer, name in (("Actions", "Play Wave"), ("More", "Look ahead")):
        operator.open_drawer(drawer)
        operator.page.get_by_role("button", name=name, exact=drawer == "More").scroll_into_view_if_needed()
        assert too_small(operator) == [], drawer
        assert operator.page.evaluate(SCROLL_SIDEWAYS) == [], drawer
    operator.open_drawer("Actions")
    operator.press("Phrases")
    operator.page.locator(".phrases .hit").first.click()
    operator.until(lambda: operator.state["speech"], "the phrase")
    operator.push("a", until=lambda: operator.state["odometry"]["w"] > 0.05, what="a turn")
    expect(operator.page.locator("#actions")).to_be_hidden()  # a drive closes the drawer
    operator.let_go("a")
    operator.until(lambda: operator.state["speech"] is None, "its end")
    operator.release()


def too_small(person: Person) -> list[str]:
    """Return the controls whose area for a finger is less than 44 px high or wide."""
    found: list[str] = person.page.evaluate(
        """() => [...document.querySelectorAll("a, button, input, select, textarea, summary")]
          .filter((one) => one.checkVisibility({ visibilityProperty: true }) && !one.closest(".skip, p"))
          .map((one) => [one, one.getBoundingClientRect(), getComputedStyle(one, "::after")])
          .filter(([, { width, height }, after]) => {
            const around = after.position === "absolute" ? after : { width: 0, height: 0 };
            const most = (size, further) => Math.max(size, parseFloat(further) || 0);
            return Math.min(most(width, around.width), most(height, around.height)) < 43.9;
          })
          .map(([one, { width, height }]) => `${one.outerHTML.slice(0, 80)} ${width}x${height}`)"""
    )
    return found


def test_every_list_has_a_search_that_keys_are_enough_for(person: Arrive) -> None:
    operator = person("operator")
    operator.take("tiago-2")
    page = operator.page
    lists = {
        "motions": [("Search motions", "WÀVE", "motion-list")],
        "speech": [
            ("Search phrases", "HOLÁ! encantado", "phrase-list"),
            ("Search languages", "spanish (SPÁIN)", "language-list"),
        ],
        "topics": [
            ("Search topics", "SCAN_RAW láserscan", "topic-list"),
            ("Search services", "LIST_MOTIONS", "service-list"),
            ("Search parameters", "ROBOT_DESCRÍPTION", "parameter-list"),
        ],
    }
    for tab, searches in lists.items():
        page.evaluate("tab => { location.hash = tab }", tab)
        for label, text, name in searches:
            if name == "language-list":
                operator.part("language").click()
            field = operator.part(name).get_by_label(label)
            rows = operator.part(name).locator("li:visible:has(button)")
            rows.first.wait_for()
            many = rows.count()
            field.fill(text)
            expect(rows, label).to_have_count(1)
            field.press("Tab")
            focused = page.evaluate("document.activeElement.closest('li')?.innerText")
            assert focused == rows.first.evaluate("row => row.innerText"), label
            field.press("Escape")
            expect(field, label).to_have_value("")
            expect(rows, label).to_have_count(many)
            field.fill(text)
            field.press("Enter")
    # Enter acts on the list that has the focus.
    operator.part("watches").get_by_text("/scan_raw").first.wait_for()
    operator.part("service-call").get_by_text("/play_motion/list_motions").first.wait_for()
    operator.part("parameter-value").get_by_text(re.compile("robot_description")).first.wait_for()
    assert operator.part("language-name").text_content() == "Spanish (Spain)"
    operator.until(lambda: operator.sent.count("say") == 1 and operator.sent.count("play") == 1, "orders")
    operator.until(lambda: not (operator.state["motion"] or operator.state["speech"]), "the end of both")
    operator.release()


def everything_is_in_sight(person: Person, width: int, height: int) -> None:
    """Check that joystick, stop and picture are in the window, large enough and apart, and that it does not scroll."""
    page_size = "[document.scrollingElement.scrollWidth, document.scrollingElement.scrollHeight]"
    assert person.page.evaluate(page_size) == [width, height]
    stick, stop = places_of_stick_and_stop(person)
    picture = box_of(person.part("picture"))
    for box in (stick, stop, picture):
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= width
        assert box["y"] + box["height"] <= height
    free = what_stays_free(person)
    assert not overlap(stick, stop)
    assert not overlap(stick, free)
    assert not overlap(stop, free)
    assert min(stick["width"], stick["height"]) >= (180 if free == picture else 170)
    assert stop["width"] >= 120
    assert stop["height"] >= 56


def what_stays_free(person: Person, part: str = "picture") -> dict[str, float]:
    """Return the place of plan or camera; on a phone held sideways, where the rest lies on it, of its middle."""
    whole = box_of(person.part(part))
    if not person.page.locator(".control[data-over]").count():
        return whole
    x, y = whole["x"] + 0.5 * whole["width"], whole["y"] + 0.6 * whole["height"]
    return {"x": x - 40, "y": y - 40, "width": 80, "height": 80}


def places_of_stick_and_stop(person: Person) -> tuple[dict[str, float], dict[str, float]]:
    """Return the places of stick and stop."""
    return box_of(person.part("zone")), box_of(person.page.locator("form.stop .stop-button"))


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_nothing_covers_stop_speeds_or_picture(person: Arrive, width: int, height: int) -> None:
    """Two people at one robot: what opens, who waits in line, long names, a long line, the reason of a stop."""
    operator, staff = (
        person(role, width=width, height=height, touch=width < 1000) for role in ("operator", "staff")
    )
    operator.take("tiago-2")
    staff.watch("tiago-2")
    nothing_covers_the_stop(staff, width, height)
    staff.open_drawer("More")
    staff.press("Swap sides")
    staff.page.keyboard.press("Escape")
    nothing_covers_the_stop(staff, width, height)

    stand_in_line(staff, operator)
    long_names_cover_nothing_and_crush_nothing(operator)
    staff.press("Leave the line")
    stand_in_line(staff, operator)
    a_long_line_covers_neither_speeds_nor_stop(operator)
    staff.press("Leave the line")
    if width < 1000:
        stand_in_line(staff, operator)
        requests_leave_the_picture_free(operator, width, height)
        staff.press("Leave the line")  # otherwise the next test waits until the offer ends
        operator.clear()
    operator.release()


def stand_in_line(staff: Person, operator: Person) -> None:
    """Ask for control, and wait until the operator is told."""
    staff.press("Ask for control")
    expect(operator.page.get_by_role("button", name="Hand over to Staff")).to_have_count(1)


def nothing_covers_the_stop(staff: Person, width: int, height: int) -> None:
    """Check that details, menu and dialogs do not cover the stop."""
    box = box_of(staff.page.locator("form.stop .stop-button"))
    spots = [[box["x"] + share * box["width"], box["y"] + box["height"] / 2] for share in (0.05, 0.5, 0.95)]

    def covering() -> list[str]:
        at = "([x, y]) => document.elementFromPoint(x, y)"
        found = f"spots.map({at}).filter((hit) => !hit?.closest('.stop-button')).map((hit) => hit?.outerHTML)"
        return list(staff.page.evaluate(f"(spots) => {found}", spots))

    assert covering() == []
    if width < 1000:
        staff.open_drawer("More")
        staff.page.locator(".details-open").click()  # a reason has a button of this name, too
        assert covering() == []
        staff.page.keyboard.press("Escape")
    staff.page.locator(".menu summary").click()
    assert covering() == []
    menu = box_of(staff.page.locator(".menu-list"))
    assert menu["y"] + menu["height"] <= height  # the list scrolls to the rest
    staff.page.locator(".menu summary").click()
    staff.press("Take over…")
    assert covering() == []
    staff.page.keyboard.press("Escape")
    assert not staff.page.get_by_role("dialog").is_visible()


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_header_has_badge_and_menu_beside_a_long_battery_text(
    person: Arrive, width: int, height: int
) -> None:
    """Regression: the menu moved to a second line of the header and opened over the stop."""
    observer = person("observer", width=width, height=height)
    observer.watch("tiago-2")
    badge = observer.page.locator(".robot-name .badge")
    expect(badge).to_be_visible()
    assert badge.evaluate(
        """(badge) => {
            const { bottom } = document.querySelector(".back").getBoundingClientRect();
            return badge.scrollWidth <= badge.clientWidth + 1 && badge.getBoundingClientRect().bottom <= bottom + 6;
        }"""
    )
    lower = observer.page.evaluate(
        """() => {
            const top = (selector) => document.querySelector(selector).getBoundingClientRect().top;
            document.querySelector("[data-part=battery]").textContent = "100 %, about 10 h 00 min left";
            return top(".menu summary") - top(".back");
        }"""
    )
    assert abs(lower) < 10.0


def requests_leave_the_picture_free(operator: Person, width: int, height: int) -> None:
    operator.page.locator("form.stop .stop-button").click()
    operator.page.get_by_role("button", name="Clear stop…").wait_for()
    picture = box_of(operator.page.locator("[data-picture-area]"))
    assert not overlap(box_of(operator.part("requests")), what_stays_free(operator))
    assert width > height or picture["width"] * picture["height"] >= 0.4 * width * height
    assert too_small(operator) == []


# Show a part for a moment. Return the texts of the buttons over the picture that this part moves or covers.
CROSSED = """(part) => {
  const box = (one) => {
    const { left, top, right, bottom } = one.getBoundingClientRect();
    return [left, top, right, bottom].map(Math.round);
  };
  const isFree = (one) => {
    const [left, top, right, bottom] = box(one);
    return one.contains(document.elementFromPoint((left + right) / 2, (top + bottom) / 2));
  };
  const buttons = [...document.querySelectorAll(".picture-area button")].filter(isFree);
  const before = buttons.map(box);
  const shown = document.querySelectorAll(`[data-part=${part}], [data-part=${part}] [data-part=going-runs]`);
  for (const one of shown) Object.assign(one, { hidden: false });
  shown[0].dataset.level = "warning";
  const over = box(shown[0]);
  const crossed = buttons.filter((one, i) => {
    const [left, top, right, bottom] = box(one);
    const isMoved = String(box(one)) !== String(before[i]);
    return isMoved || !(right <= over[0] || over[2] <= left || bottom <= over[1] || over[3] <= top);
  });
  const texts = crossed.map((one) => one.ariaLabel || one.textContent);
  for (const one of shown) one.hidden = true;
  return [buttons.length, texts];
}"""


def what_comes_by_itself_covers_no_button_of_the_picture(operator: Person) -> None:
    """Check this over the plan and over the map."""
    for opener in ("robot-open", "map-open"):
        expect(operator.part(opener)).to_be_visible()
    nothing_is_crossed(operator)
    operator.part("map-open").click()
    expect(operator.page.locator(".map-canvas")).to_be_visible()
    nothing_is_crossed(operator)
    operator.part("map-open").click()
    expect(operator.page.locator(".map-canvas")).to_be_hidden()


def nothing_is_crossed(operator: Person) -> None:
    for part in ("reason", "running"):
        buttons, crossed = operator.page.evaluate(CROSSED, part)
        assert buttons > 2
        assert crossed == [], part


def a_long_line_covers_neither_speeds_nor_stop(operator: Person) -> None:
    free = operator.page.evaluate(
        """() => {
          const line = document.querySelector("[data-part=requests]");
          for (let number = 0; number < 8; number++) line.append(line.firstElementChild.cloneNode(true));
          const places = [".drive .segments button:first-child", ".drive .zone", "form.stop .stop-button"];
          return places.map((place) => {
            const { x, y, width, height } = document.querySelector(place).getBoundingClientRect();
            return Boolean(document.elementFromPoint(x + width / 2, y + height / 2)?.closest(place));
          });
        }"""
    )
    assert free == [True, True, True]


def long_names_cover_nothing_and_crush_nothing(operator: Person) -> None:
    place = box_of(operator.page.locator("form.stop .stop-button"))
    # Measure immediately: the page's script soon writes the real names again.
    back, burger, stop_now, free = operator.page.evaluate(
        """name => {
          for (const place of ["h1", ".menu-name", "[data-part=who]", ".requests span", ".requests .button"])
            document.querySelector(place).textContent = name;
          const boxes = [".back", ".menu svg", "form.stop .stop-button", ".drive .speed"].map((place) => {
            const { x, y, width, height } = document.querySelector(place).getBoundingClientRect();
            return { x, y, width, height };
          });
          const { x, y, width } = boxes.pop();
          const on = (share) => document.elementFromPoint(x + share * width, y + 20).closest(".drive");
          return [...boxes, [0.1, 0.5, 0.9].every(on)];
        }""",
        A_LONG_NAME,
    )
    assert (back["width"], burger["width"]) == (44, 20)
    assert stop_now == place
    assert free, "the name lies over the speeds"


def test_the_theme_is_kept(person: Arrive) -> None:
    staff = person("staff", theme="light")
    staff.open("/")
    background = "getComputedStyle(document.documentElement).backgroundColor"
    light = staff.page.evaluate(background)
    staff.page.locator(".menu summary").click()
    staff.press("Light or dark")
    dark = staff.page.evaluate(background)
    staff.open("/accounts/sessions/")
    assert staff.page.evaluate(background) == dark != light


def test_cards_say_how_each_robot_is(person: Arrive) -> None:
    operator = person("operator")
    operator.open("/")
    expect(operator.page.locator("[data-robot=tiago-1]")).not_to_contain_text("Online")  # it is off
    card = operator.page.locator("[data-robot=tiago-2]")
    card.get_by_text("Online").wait_for()
    assert card.get_by_text("simulated").is_visible()
    card.get_by_role("link", name="Open TIAGo Two").click()
    operator.page.wait_for_url("**/robots/tiago-2/")


def box_of(element: Locator) -> dict[str, float]:
    """Return an element's box in the window, pixels."""
    box = element.bounding_box()
    assert box is not None
    return {"x": box["x"], "y": box["y"], "width": box["width"], "height": box["height"]}


def overlap(a: dict[str, float], b: dict[str, float]) -> bool:
    """Return whether two boxes share a pixel."""
    beside = a["x"] + a["width"] <= b["x"] or b["x"] + b["width"] <= a["x"]
    above = a["y"] + a["height"] <= b["y"] or b["y"] + b["height"] <= a["y"]
    return not (beside or above)
