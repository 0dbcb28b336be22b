"""Notifications in a real browser: at once on every open page, and a push to the service worker."""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

from playwright.sync_api import expect

from script.stack.stack import Stack
from tests.browser.people import Person
from tests.browser.test_pages import SIZES

Arrive = Callable[..., Person]
YOURS = "TIAGo Two: your turn"
SHOWN = """() => navigator.serviceWorker.ready.then((worker) => worker.getNotifications())
  .then((all) => all.map(({ title, body, data }) => [title, body, data.path]))"""


def told(stack: Stack, username: str) -> None:
    """Store a notification, as another process does."""
    now = datetime.now(UTC).replace(tzinfo=None)
    with sqlite3.connect(stack.directory / "fleet.sqlite3", timeout=20) as database:
        database.execute(
            "INSERT INTO bookings_letter (person_id, subject, text, path, until, made_at)"
            " SELECT id, ?, 'Take control within 90 seconds.', '/robots/tiago-2/', ?, ? FROM accounts_user"
            " WHERE username = ?",
            [YOURS, str(now + timedelta(minutes=5)), str(now), username],
        )


def test_news_are_on_every_open_page_at_once(stack: Stack, person: Arrive) -> None:
    operator = person("operator", apart=True)
    pages = [operator.page, operator.context.new_page(), operator.context.new_page()]
    for page, path in zip(pages, ("/bookings/mine/", "/", "/robots/tiago-2/"), strict=True):
        with page.expect_websocket(lambda socket: "/ws/news/" in socket.url):
            page.goto(stack.url + path)
    told(stack, operator.account.username)
    for page in pages[:2]:
        expect(page.get_by_role("link", name=YOURS)).to_be_visible()
    for width, height in SIZES:
        pages[2].set_viewport_size({"width": width, "height": height})
        expect(pages[2].locator("[data-part=stop]")).to_be_visible()
    expect(pages[2].locator("[data-part=notices]")).to_contain_text(YOURS)
    told(stack, operator.account.username)
    pages[0].set_viewport_size({"width": 360, "height": 640})
    more = pages[0].get_by_role("button", name=re.compile(r"^\d+ more$"))
    expect(more).to_be_visible()
    expect(pages[0].locator(".news li:visible")).to_have_count(1)
    expect(pages[0].locator(".news-text:visible")).to_have_count(0)
    pages[0].set_viewport_size({"width": 844, "height": 390})
    room = pages[0].locator(".news").bounding_box()
    assert room and room["height"] < 60, "one line on a phone that is held sideways"
    more.click()
    expect(pages[0].locator(".news-text:visible")).to_have_count(2)
    pages[0].get_by_role("button", name="Seen").click()
    expect(pages[1].get_by_role("link", name=YOURS)).to_have_count(0)


def test_a_push_is_shown_by_the_worker(stack: Stack, person: Arrive) -> None:
    newcomer = person("operator", newcomer=True, apart=True)  # with a service worker
    newcomer.context.grant_permissions(["notifications"], origin=stack.url)
    newcomer.open("/bookings/devices/")
    expect(newcomer.page.get_by_role("button", name="Notify me on this device")).to_be_visible()
    newcomer.page.evaluate("navigator.serviceWorker.ready.then(() => null)")
    devtools: Any = newcomer.context.new_cdp_session(newcomer.page)
    registered: list[str] = []
    devtools.on(
        "ServiceWorker.workerRegistrationUpdated",
        lambda event: registered.extend(one["registrationId"] for one in event["registrations"]),
    )
    devtools.send("ServiceWorker.enable")
    newcomer.until(lambda: registered, "the worker")
    push = {"title": YOURS, "body": "Take control", "path": "/robots/tiago-2/", "tag": "7"}
    sent = {"origin": stack.url, "registrationId": registered[0], "data": json.dumps(push)}
    devtools.send("ServiceWorker.deliverPushMessage", sent)
    newcomer.until(
        lambda: newcomer.page.evaluate(SHOWN) == [[YOURS, "Take control", "/robots/tiago-2/"]], "it"
    )
