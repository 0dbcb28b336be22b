"""A recording is found in the list and replayed: plan, picture, stick, plots, events, and only the own part."""

from __future__ import annotations

import io
import json
import re
import struct
from collections.abc import Callable, Iterator
from contextvars import copy_context
from datetime import datetime, timedelta
from mimetypes import guess_type
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import PIL.Image
import pytest
from django.contrib.staticfiles import finders
from django.test import Client
from django.utils import timezone
from mcap.writer import Writer
from playwright.sync_api import Browser, Page, Route, expect

from fleet.accounts.models import User
from fleet.audit.services import record
from robots.recordings.models import Recording
from robots.registry.models import Robot
from robots.shared import wire
from teleop.models import ControlSession
from tests.teleop.recordings.test_sight import BEGAN, session
from tests.teleop.support import IDLE

HOST = "http://console.test"
SIZES = ((360, 640), (844, 390), (1440, 900))
STOPPED_S = 35.0
PICTURE = """uint8[] data
string format
"""


def write(path: Path, begins_at: datetime = BEGAN) -> None:
    """Write 45 s: it drives forward, is stopped after 35 s, and its camera turns from red to green."""
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=50_000)
        writer.start(profile="ros1", library="test")
        json_kind = writer.register_schema("v", "jsonschema", b"{}")
        views, commands = (
            writer.register_channel(topic, "json", json_kind) for topic in ("/fleet/view", "/fleet/command")
        )
        kind = writer.register_schema("sensor_msgs/CompressedImage", "ros1msg", PICTURE.encode())
        camera = writer.register_channel("/xtion/rgb/compressed", "ros1", kind)
        for tick in range(450):
            at_ns = int(begins_at.timestamp() * 1e9) + tick * 100_000_000
            stopped = tick >= STOPPED_S * 10
            state = wire.encode(IDLE)
            shown = json.loads(state) | {"text": "stopped" if stopped else "drives"}
            shown["odometry"]["vx"] = 0.0 if stopped else 0.3
            view = {"t": "view", "state": shown, "scan": {"laser_cm": [200, 0, 200, 50], "unseen": []}}
            writer.add_message(views, at_ns, json.dumps(view).encode(), at_ns, tick)
            if not stopped:
                drive = {"drive": {"t": "drive", "x": 0.8, "w": 0.0, "seq": tick}}
                writer.add_message(commands, at_ns, json.dumps(drive).encode(), at_ns, tick)
            if tick % 5 == 0:
                writer.add_message(camera, at_ns, picture("green" if stopped else "red"), at_ns, tick)
        writer.finish()  # type: ignore[no-untyped-call]


def picture(colour: str) -> bytes:
    packed = io.BytesIO()
    PIL.Image.new("RGB", (32, 24), colour).save(packed, "JPEG")
    data = packed.getvalue()
    return struct.pack("<I", len(data)) + data + struct.pack("<I", 4) + b"jpeg"


@pytest.fixture
def recording(_beside_a_loop: None, robot: Robot, operator: User, tmp_path: Path) -> Recording:
    write(tmp_path / "one.mcap")
    session(robot, operator, 0, 0.7)
    stop = {"event": "stop", "at": BEGAN.timestamp() + STOPPED_S, "text": "Emergency stop", "by": "Olga"}
    return Recording.objects.create(
        robot=robot,
        person=operator,
        kind="black_box",
        begins_at=BEGAN,
        ends_at=BEGAN + timedelta(seconds=45),
        directory=str(tmp_path),
        file="one.mcap",
        bytes=(tmp_path / "one.mcap").stat().st_size,
        events=[stop],
    )


@pytest.fixture
def page_of(_beside_a_loop: None, browser: Browser) -> Iterator[Callable[[User], Page]]:
    """`page_of(person)`: a page of theirs, which Django answers in this process."""
    opened = []
    here = copy_context()  # it has the test's connection to the database

    def of(person: User) -> Page:
        client = Client(enforce_csrf_checks=True)
        client.force_login(person)
        context = browser.new_context(reduced_motion="reduce", service_workers="block")
        opened.append(context)
        page = context.new_page()
        page.route_web_socket("**/*", lambda _socket: None)
        page.route("**/*", lambda route: here.copy().run(_answer, route, client))
        return page

    yield of
    for context in opened:
        context.close()


def _answer(route: Route, client: Client) -> None:
    request = route.request
    address = urlsplit(request.url)
    if address.path.startswith("/static/"):
        found = str(finders.find(address.path.removeprefix("/static/")))
        route.fulfill(path=found, content_type=guess_type(found)[0] or "text/plain")
        return
    headers = {"accept": request.headers["accept"], "x-csrftoken": request.headers.get("x-csrftoken", "")}
    path, body = f"{address.path}?{address.query}", request.post_data_buffer or b""
    answer: Any = client.generic(request.method, path, body, "application/json", headers=headers)
    content = b"".join(answer.streaming_content) if answer.streaming else answer.content
    route.fulfill(status=answer.status_code, content_type=answer.get("Content-Type", ""), body=content)


def test_a_stop_is_found_and_watched(
    recording: Recording, robot: Robot, operator: User, page_of: Callable[[User], Page]
) -> None:
    page = page_of(operator)
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(f"{HOST}/recordings/?event=stop")
    page.get_by_role("link", name="TIAGo 1").click()
    part = page.locator
    expect(part("[data-part=time]")).to_have_text("0:05.0 / 0:45.0")  # 30 s before the stop
    expect(part("[data-part=says]")).to_have_text("drives")
    expect(part("[data-part=knob]")).to_have_attribute("data-held", "true")
    expect(part("[data-part=camera]")).to_be_visible()
    page.get_by_role("button", name="emergency stop").click()
    expect(part("[data-part=says]")).to_have_text("stopped")
    part("[data-part=after]").click()
    part("[data-part=speed]").select_option("8")
    part("[data-part=play]").click()
    expect(part("[data-part=time]")).to_have_text("0:45.0 / 0:45.0")
    part("[data-part=plot-topic]").select_option("/fleet/view")
    part("[data-part=plot-field]").select_option("state.odometry.vx")
    expect(part("[data-part=plots] canvas")).to_be_visible()
    page.goto(f"{HOST}{urlsplit(page.url).path}?t=12.3")
    expect(part("[data-part=time]")).to_have_text("0:12.3 / 0:45.0")
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= width, (width, wide)
        assert part("[data-part=picture]").evaluate("(canvas) => canvas.clientHeight") > 150
    assert faults == []


def test_what_the_log_has_of_it_is_on_the_timeline(
    recording: Recording, robot: Robot, operator: User, tmp_path: Path, page_of: Callable[[User], Page]
) -> None:
    begins_at = timezone.now() - timedelta(seconds=20)
    write(tmp_path / "one.mcap", begins_at)
    own = ControlSession.objects.create(robot=robot, user=operator, fence=7, started_at=begins_at)
    Recording.objects.update(begins_at=begins_at, ends_at=begins_at + timedelta(seconds=45), events=[])
    facts = {"actor": operator, "robot_id": robot.pk, "robot_name": robot.name, "session_id": own.pk}
    record("speech.start", text="Mind the cupboard", **facts)
    page = page_of(operator)
    page.set_viewport_size({"width": 360, "height": 640})
    page.goto(f"{HOST}/recordings/{recording.pk}/")
    expect(page.locator("[data-part=time]")).to_have_text("0:00.0 / 0:45.0")
    expect(page.locator("[data-part=marks] .record")).to_have_count(1)
    page.get_by_role("button", name="Mind the cupboard").click()
    expect(page.locator("[data-part=time]")).to_have_text(re.compile(r"0:2\d\.\d / 0:45\.0"))
    expect(page.get_by_role("button", name="Mind the cupboard")).to_have_attribute("aria-current", "true")


def test_a_student_cannot_watch_the_session_before(
    recording: Recording, robot: Robot, second_operator: User, page_of: Callable[[User], Page]
) -> None:
    Recording.objects.update(person=None)
    session(robot, second_operator, 0.7, 2)  # from the 42nd second on
    page = page_of(second_operator)
    page.goto(f"{HOST}/recordings/{recording.pk}/?t=10")
    expect(page.locator("[data-part=time]")).to_have_text("0:42.0 / 0:45.0")
    expect(page.locator("[data-part=says]")).to_have_text("stopped")
    expect(page.get_by_text("Nothing is marked in this recording.")).to_be_visible()
    expect(page.locator("[data-part=delete]")).to_have_count(0)


def test_it_is_kept_shared_and_deleted(
    recording: Recording, operator: User, second_operator: User, page_of: Callable[[User], Page]
) -> None:
    page = page_of(operator)
    page.goto(f"{HOST}/recordings/{recording.pk}/")
    expect(page.locator("[data-part=time]")).not_to_be_empty()  # the page listens
    page.get_by_role("button", name="Keep it").click()
    expect(page.get_by_role("button", name="Keep no longer")).to_be_visible()
    expect(page.locator("[data-part=time]")).not_to_be_empty()
    page.get_by_label("User name, or short name").fill("nobody")
    page.get_by_role("button", name="Share", exact=True).click()
    expect(page.locator("[data-part=change-problem]")).to_have_text("No person and no course has this name.")
    page.get_by_label("User name, or short name").fill(second_operator.username)
    page.get_by_role("button", name="Share", exact=True).click()
    expect(page.get_by_role("button", name="End sharing")).to_be_visible()
    expect(page.locator("[data-part=time]")).not_to_be_empty()
    page.get_by_role("button", name="Delete").first.click()
    page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    page.wait_for_url("**/recordings/")
    expect(page.get_by_text("There is no recording yet.")).to_be_visible()
