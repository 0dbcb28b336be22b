"""The first window of fleet page and calendar, and the header's links: Django answers in this process."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator
from mimetypes import guess_type
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import msgspec
import pytest
from django.contrib.staticfiles import finders
from django.test import Client
from playwright.sync_api import Browser, Page, Route, WebSocketRoute, expect

from fleet.accounts.models import User
from robots.registry.models import Robot
from robots.shared import wire
from robots.shared.wire.state import StopState
from tests.browser.moments.driving_page import ORIGIN, DrivingPage, pages_of
from tests.browser.moments.scenes import MOMENTS, READY, WALL
from tests.browser.people import MADE_UP_LANGUAGE
from tests.browser.test_pages import box_of, overlap

SLOT_PX = 24.0  # half an hour of the calendar, the library's own height
LANGUAGES = ("", "longer", "mirrored")  # of `MADE_UP_LANGUAGE`, one after the other on the same page
SHOTS = os.environ.get("MOMENT_SHOTS")

DRIVEN = wire.FleetCard(
    msgspec.structs.replace(READY, holder="Wilhelmina Konstantinopoulou", verdict=WALL),
    booked=wire.Booked("Wilhelmina Konstantinopoulou", mine=False, seconds=2700.0),
    next_booked=wire.Booked("Cleo Student", mine=False, seconds=2700.0),
    free_in_s=6300.0,
)
CARDS = (
    DRIVEN,
    wire.FleetCard(READY, free_in_s=0.0),
    wire.FleetCard(msgspec.structs.replace(READY, stop=StopState("stopped", by="Supervisor")), free_in_s=0.0),
    wire.FleetCard(
        None,
        wire.Refusal("bridge_down", "The robot’s bridge is not running: nobody can drive it now.", "robot"),
    ),
    wire.FleetCard(
        READY, out=wire.Refusal("out_of_service", "Out of service until further notice.", "robot")
    ),
    wire.FleetCard(READY, free_in_s=0.0),
)

Open = Callable[..., Page]


@pytest.fixture(autouse=True)
def _beside_a_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DJANGO_ALLOW_ASYNC_UNSAFE", "1")  # Playwright runs an event loop in this thread


@pytest.fixture
def open_page(_beside_a_loop: None, browser: Browser, robot: Robot, staff: User) -> Iterator[Open]:
    """`open_page("/bookings/", 844, 390)`: a page of staff, of six robots, in a window of this size."""
    for number in range(2, 7):
        Robot.objects.create(
            slug=f"tiago-{number}", name=f"TIAGo {number}", profile=robot.profile, master_uri=robot.master_uri
        )
    client = Client(headers={"accept-language": os.environ.get("MOMENT_LANGUAGE", "en")})
    client.force_login(staff)
    context = browser.new_context(reduced_motion="reduce", service_workers="block")
    page = context.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)

    feed = client.get("/bookings/feed/?start=2026-03-02&end=2026-03-03")
    pages: dict[str, tuple[str, bytes]] = {"/bookings/feed/": (feed["Content-Type"], feed.content)}
    slugs = list(Robot.objects.order_by("name").values_list("slug", flat=True))

    def answer(route: Route) -> None:
        path = urlsplit(route.request.url).path
        if path.startswith("/static/"):
            found = str(finders.find(path.removeprefix("/static/")))
            route.fulfill(path=found, content_type=guess_type(found)[0] or "text/plain")
        else:
            kind, body = pages[path]
            route.fulfill(content_type=kind, body=body)

    def fleet(socket: WebSocketRoute) -> None:
        socket.send(wire.encode(wire.Fleet(dict(zip(slugs, CARDS, strict=True)))).decode())
        socket.on_message(lambda text: pong(socket, json.loads(text)))

    def pong(socket: WebSocketRoute, message: dict[str, Any]) -> None:
        if message["t"] == "ping":
            socket.send(wire.encode(wire.Pong(message["sent_ms"])).decode())

    cameras = wire.encode(wire.Cameras([wire.CameraEntry("head", "Head camera", True)])).decode()
    page.route("**/*", answer)
    page.route_web_socket(re.compile("/ws/fleet/$"), fleet)
    page.route_web_socket(re.compile("/ws/(bookings|news)/$"), lambda _silent: None)
    page.route_web_socket(re.compile("/camera/$"), lambda socket: socket.send(cameras))

    def open_one(path: str, width: int, height: int) -> Page:
        page.set_viewport_size({"width": width, "height": height})
        pages.update(pages_of(client, path))
        page.goto(ORIGIN + path)
        return page

    yield open_one
    context.close()
    assert complaints == []


def in_each_language(page: Page, name: str) -> Iterator[str]:
    """Turn the page into each of `LANGUAGES`."""
    for language in LANGUAGES:
        if language:
            page.evaluate(MADE_UP_LANGUAGE, language)
        if SHOTS:
            page.wait_for_timeout(200)
            page.screenshot(path=Path(SHOTS) / f"{name}-{language or 'plain'}.png")
        yield language


def free_rows(page: Page) -> tuple[float, float]:
    """Return top and bottom of the window between header and dock, which is in the header of a low window; pixels."""
    header, dock = (box_of(page.locator(name)) for name in (".top", ".dock"))
    top = header["y"] + header["height"]
    height = page.evaluate("innerHeight")
    return top, dock["y"] if dock["y"] >= top else float(height)


@pytest.mark.parametrize(("width", "height", "whole"), [(1440, 900, 6), (844, 390, 1), (360, 640, 1)])
def test_whole_cards_are_in_the_first_window(open_page: Open, width: int, height: int, whole: int) -> None:
    page = open_page("/", width, height)
    expect(page.locator(".thumbnail:visible")).to_have_count(6)
    expect(page.locator(".robot").get_by_text("Wilhelmina").first).to_be_visible()
    expect(page.locator("a[data-part=book]:visible")).to_have_count(5)
    expect(page.get_by_text("Out of service", exact=True)).to_have_count(1)
    for language in in_each_language(page, f"fleet-{width}"):
        top, bottom = free_rows(page)
        buttons = [box_of(row) for row in page.locator(".robot-actions").all()[:whole]]
        cards = [box_of(card) for card in page.locator(".robot").all()[:whole]]
        assert all(top <= one["y"] for one in cards), (language, cards)
        assert all(one["y"] + one["height"] <= bottom for one in buttons), (language, bottom, buttons)
        assert all(one["height"] >= 44.0 for one in buttons)


def test_six_rows_of_the_calendar_fit_a_phone_held_sideways(open_page: Open) -> None:
    page = open_page("/bookings/", 844, 390)
    page.locator(".ec-slot:visible").first.wait_for()
    for language in in_each_language(page, "calendar-844"):
        top, bottom = free_rows(page)
        body, head = box_of(page.locator(".ec-main")), box_of(page.locator(".ec-header"))
        shown = min(bottom, body["y"] + body["height"]) - max(top, head["y"] + head["height"])
        assert shown / SLOT_PX >= 6.0, language


@pytest.mark.parametrize("width", [360, 1024, 1440])
@pytest.mark.parametrize("path", ["/cookies/", "/admin/"])
def test_each_link_is_in_the_header_or_in_the_menu(open_page: Open, path: str, width: int) -> None:
    page = open_page(path, width, 900)
    menu = page.locator(".menu summary")
    for language in in_each_language(page, f"header-{path.strip('/')}-{width}"):
        menu.click()
        row, listed = page.locator("[data-pages] a:visible"), page.locator("[data-menu-pages] a:visible")
        expect(listed).to_have_count(11 - row.count())
        assert bool(row.count()) == (width > 1000)
        assert not [link for link in row.all() if overlap(box_of(link), box_of(menu))], language
        assert page.evaluate("document.scrollingElement.scrollWidth") == width
        menu.click()


def test_plots_load_their_library_when_one_has_room(driving: DrivingPage) -> None:
    page, asked = driving.page, list[str]()
    page.on("request", lambda request: asked.append(request.url))
    page.set_viewport_size({"width": 360, "height": 640})
    driving.show(MOMENTS[0])
    assert [url for url in asked if url.endswith("js/control/control_page.js")]
    assert not [url for url in asked if "/plots/library.js" in url]
    page.set_viewport_size({"width": 1440, "height": 900})
    expect(page.locator("[data-part=chart] canvas")).to_be_visible()
    assert driving.complaints == []


def test_a_report_has_its_bars(open_page: Open) -> None:
    page = open_page("/robots/tiago-1/report/", 1440, 900)
    expect(page.locator(".bars canvas")).to_have_count(3)


def test_the_driving_page_takes_over_the_early_connection(driving: DrivingPage) -> None:
    made = "static made = []; constructor(url) { super(url); WebSocket.made.push(url); }"
    driving.page.add_init_script(f"WebSocket = class extends WebSocket {{ {made} }}")
    driving.show(MOMENTS[0])
    urls = driving.page.evaluate("WebSocket.made")
    robots = [url.rpartition("/robots/")[2] for url in urls if "/robots/" in url]
    assert robots == ["tiago-1/", "tiago-1/camera/"]
    assert driving.complaints == []
