"""The cameras' WebSocket: permissions, the pictures that a viewer gets, and records."""

import asyncio
import time

import msgspec
import pytest

from fleet.audit.models import Record
from robots.bridge.camera.picture_server import PictureServer
from robots.link.client import links
from robots.registry.models import Robot, RobotRole
from robots.registry.selectors import link_address
from robots.shared import wire
from robots.shared.wire import CameraState, LinkProcess, Refusal, TakenPicture
from teleop.background.database import in_database
from teleop.camera import camera_consumer, feed
from teleop.live.consumers.message_socket import CloseCode
from teleop.records import camera_audit, repeat_suppression
from tests.teleop.support import Page, eventually

pytestmark = pytest.mark.django_db(transaction=True)

CAMERA = "head"
LONGEST_S = 3.0  # the console checks twice a second; a busy computer needs longer
HEADER = TakenPicture(CAMERA, "full", 1, "jpeg", 640, 480, age_s=0.04)


class CameraProcess:
    """The robot's camera process, whose pictures the test makes."""

    def __init__(self, robot):
        self.wants = {}
        self.keys = []
        self._server = PictureServer(link_address(robot), self._set_wants, self.keys.append)
        self._changed = asyncio.Event()

    async def start(self, bridge):
        """Listen, and let the bridge send the address."""
        self.at = await self._server.start()
        bridge.say(self.at)
        return self

    async def close(self):
        await self._server.close()

    def _set_wants(self, wants):
        self.wants = wants
        self._changed.set()

    async def is_asked_for(self, wants):
        while self.wants != wants:
            self._changed.clear()
            await asyncio.wait_for(self._changed.wait(), 5.0)

    def show(self, number, encoded=b"picture", **changes):
        header = msgspec.structs.replace(HEADER, number=number, **changes)
        self._server.show(header, encoded, time.monotonic())

    def report(self, refusal):
        self._server.report(CameraState(CAMERA, refusal))


@pytest.fixture
async def process(robot, bridge):
    running = CameraProcess(robot)
    yield running
    await running.close()


@pytest.fixture
async def open_cameras(robot, browsers, websocket_headers, bridge):
    """`await open_cameras("observer")`: that person's connection to the cameras of `robot`."""
    opened = []

    async def open_one(who, slug=robot.slug):
        page = Page(websocket_headers(browsers[who]), f"/ws/robots/{slug}/camera/")
        opened.append(page)
        return await page.open()

    yield open_one
    for page in opened:
        await page.close()


@pytest.fixture
async def watching(open_cameras, bridge, process):
    """`await watching("observer")`: a connection that is ready for its first picture."""

    async def watch(who, **fields):
        page = await open_cameras(who)
        await page.say("camera_watch", camera=CAMERA, **fields)
        await bridge.hears(LinkProcess, lambda message: message.wanted)
        if not hasattr(process, "at"):
            await process.start(bridge)
        return page

    return watch


async def painted(page, number):
    await page.say("camera_ack", camera=CAMERA, number=number)


@pytest.mark.parametrize("slug", ["tiago-1", "no-such-robot"])
async def test_stranger_does_not_learn_that_the_robot_exists(slug, open_cameras):
    assert await (await open_cameras("stranger", slug)).is_closed() == CloseCode.NOT_FOUND


async def test_the_robots_cameras_are_named(open_cameras):
    page = await open_cameras("observer")
    [camera] = (await page.hears("cameras"))["cameras"]
    assert camera == {"name": CAMERA, "label": "Head camera", "moves": True}


async def test_the_camera_process_starts_before_the_page_asks_for_a_picture(open_cameras, bridge):
    await open_cameras("observer")
    await bridge.hears(LinkProcess, lambda message: message.wanted)


async def test_the_camera_process_leaves_a_page_that_watches_nothing(
    open_page, open_cameras, robot, bridge, monkeypatch
):
    await open_page("operator")
    # A request from before the link would never be sent, and so not be ended.
    await links.get(robot.id, link_address(robot)).tried.wait()
    monkeypatch.setattr(camera_consumer, "WATCHES_WITHIN_S", 0.01)
    await open_cameras("observer")
    await bridge.hears(LinkProcess, lambda message: not message.wanted)


async def test_a_picture_reaches_its_viewer_as_it_is(watching, process):
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    process.show(1, b"\xff\xd8 as it is \xff\xd9", lens=(500.0, 500.0, 320.0, 240.0))
    picture = await page.hears("picture")
    assert picture["encoded"] == b"\xff\xd8 as it is \xff\xd9"
    assert (picture["format"], picture["width"], picture["lens"]) == (
        "jpeg",
        640,
        [500.0, 500.0, 320.0, 240.0],
    )
    await page.say("ping", sent_ms=1.0)
    age_ms = (await page.hears("camera_pong"))["now_ms"] - picture["taken_ms"]
    assert 40.0 <= age_ms < 2000.0


async def test_an_unacknowledged_viewer_gets_two_then_the_newest(watching, process):
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    seen = []
    for number in range(1, 8):
        process.show(number, b"%d" % number)
        await asyncio.sleep(0.06)
    while len(seen) < 2:
        seen.append(await page.hears("picture"))
    await page.hears_nothing("picture")
    await painted(page, seen[-1]["number"])
    assert (await page.hears("picture"))["encoded"] == b"7"


async def test_a_stalled_viewer_does_not_hold_up_others(watching, process):
    stalled, other = await watching("observer"), await watching("operator")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    for number in range(1, 21):
        process.show(number)
        await painted(other, (await other.hears("picture"))["number"])
        await asyncio.sleep(0.03)
    await stalled.hears("picture")
    await stalled.hears("picture")
    await stalled.hears_nothing("picture")


async def test_no_picture_is_made_for_a_viewer_who_stalls_until_it_goes_on(watching, process, monkeypatch):
    monkeypatch.setattr(feed, "STALLED_S", 0.1)
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    for number in (1, 2):
        process.show(number)
        last = await page.hears("picture")
    await process.is_asked_for({})
    await painted(page, last["number"])
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    process.show(1, b"anew")
    assert (await page.hears("picture"))["encoded"] == b"anew"


async def test_viewers_learn_why_no_picture_comes(watching, process):
    page = await watching("observer")
    await page.hears("camera_state", camera=CAMERA)
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    process.report(Refusal("camera_silent", "The camera has sent no picture for 5 s.", "robot"))
    while (state := await page.hears("camera_state"))["refusal"]["code"] != "camera_silent":
        pass
    process.report(None)
    assert (await page.hears("camera_state")).get("refusal") is None
    assert state["refusal"]["text"] == "The camera has sent no picture for 5 s."


async def test_a_lost_camera_process_is_reported_and_found_again(watching, process, bridge):
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    process.show(1)
    await page.hears("picture")
    await process.close()
    bridge.say(wire.ProcessAt("camera"))
    assert (await page.hears("camera_state"))["refusal"]["code"] == "camera_starts"
    await painted(page, 1)
    await process.start(bridge)
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    process.show(1, b"anew")
    assert (await page.hears("picture"))["encoded"] == b"anew"


async def test_the_end_of_a_camera_process_is_said_in_words(watching, process, bridge):
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    await process.close()
    refusal = Refusal("camera_hung", "The camera’s process hung. It is started again.", "robot")
    bridge.say(wire.ProcessAt("camera", refusal=refusal))
    while (await page.hears("camera_state"))["refusal"] is None:
        pass
    while (await page.hears("camera_state"))["refusal"]["text"] != refusal.text:
        pass


async def test_pictures_end_with_the_right_to_see_the_robot(watching, process, bridge, observer):
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    begun_s = time.monotonic()
    await in_database(lambda: RobotRole.objects.filter(user=observer).delete())
    assert await page.is_closed() == CloseCode.NOT_PERMITTED
    assert time.monotonic() - begun_s < LONGEST_S
    await bridge.hears(LinkProcess, lambda message: not message.wanted)


async def test_each_viewing_is_on_record(watching, process, observer):
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    process.show(1)
    await page.hears("picture")
    await page.say("camera_end", camera=CAMERA)

    end = await eventually(lambda: Record.objects.filter(kind="camera.end").select_related("of").first())
    assert (end.actor_id, end.of.kind, end.of.actor_id) == (
        str(observer.pk),
        "camera.start",
        str(observer.pk),
    )
    assert end.of.parameters == {"camera": CAMERA}


async def test_thumbnails_leave_the_record_budget_of_full_pictures(
    watching, open_cameras, process, monkeypatch
):
    monkeypatch.setattr(repeat_suppression, "RECORDS_BURST", 1.0)
    monkeypatch.setattr(repeat_suppression, "RECORDS_PER_S", 0.001)
    for budgets in ("_budgets", "_small_budgets"):
        monkeypatch.setattr(camera_audit, budgets, repeat_suppression.RecordBudgets())
    await watching("operator")  # so the camera process runs all the time
    page = await open_cameras("observer")
    for number in (1, 2):
        await page.say("camera_watch", camera=CAMERA, size="small")
        await process.is_asked_for({CAMERA: {"full": 30.0, "small": 30.0}})
        process.show(number, variant="small")
        if number == 2:
            await page.refused("busy")
        else:
            await page.hears("picture")
        await page.say("camera_end", camera=CAMERA)
        await process.is_asked_for({CAMERA: {"full": 30.0}})
    await page.say("camera_watch", camera=CAMERA)
    process.show(3)
    await page.hears("picture")


async def test_nobody_watches_after_the_last_viewer_left(watching, process, bridge):
    page = await watching("observer")
    await process.is_asked_for({CAMERA: {"full": 30.0}})
    await page.close()
    await bridge.hears(LinkProcess, lambda message: not message.wanted)


@pytest.mark.parametrize(
    ("message", "code"),
    [
        ({"t": "camera_watch", "camera": "rear"}, "no_camera"),
        ({"t": "camera_watch", "camera": "../etc"}, "invalid"),
        ({"t": "camera_watch", "camera": CAMERA, "rate_hz": 1000}, "invalid"),
        ({"t": "camera_ack", "camera": CAMERA, "number": -1}, "invalid"),
        ({"t": "drive", "fence": 1}, "invalid"),
    ],
)
async def test_bad_messages_are_refused_with_a_code(open_cameras, message, code):
    page = await open_cameras("observer")
    await page.say(**message)
    assert (await page.hears("refused"))["refusal"]["code"] == code


async def test_a_camera_taken_from_the_robot_is_shown_no_more(watching, process, robot, bridge):
    page = await watching("observer")
    await page.hears("cameras")

    def without_cameras():
        changed = Robot.objects.get(pk=robot.pk)
        changed.overrides = {"topics": {"cameras": []}}
        changed.save()

    await in_database(without_cameras)
    assert (await page.hears("cameras"))["cameras"] == []
    await bridge.hears(LinkProcess, lambda message: not message.wanted)
