"""Viewings of cameras are recorded from the first picture to the last."""

from datetime import timedelta
from uuid import uuid4

import msgspec
import pytest
from django.core.management import call_command
from django.utils import timezone

from fleet.audit.models import Record
from fleet.audit.services import record
from robots.registry.models import RobotRole
from robots.shared import wire
from teleop.background.database import in_database
from teleop.records import camera_audit, repeat_suppression
from tests.teleop.support import Page, eventually

pytestmark = pytest.mark.django_db(transaction=True)

CAMERA = "/xtion/rgb/image_raw/compressed"


@pytest.fixture
async def page(robot, browsers, websocket_headers, bridge):
    """The observer's connection to the topics of `robot`."""
    opened = await Page(websocket_headers(browsers["observer"]), f"/ws/robots/{robot.slug}/topics/").open()
    yield opened
    await opened.close()


async def picture(bridge, page, number=1, **fields):
    """Send a picture that the page draws."""
    shown = wire.Sample(CAMERA, "sensor_msgs/CompressedImage", number, 5.0, 4, None, 1, {"data": [1]})
    encoded = wire.encode(msgspec.structs.replace(shown, **fields))
    bridge.say(wire.LinkSample(CAMERA, msgspec.Raw(encoded)))
    await page.hears("sample", number=number)
    await page.say("ack")


async def look(bridge, page):
    await page.say("subscribe", topic=CAMERA, rate_hz=10.0)
    await bridge.hears(wire.LinkSubscribe, lambda looks: CAMERA in looks.topics)


def found(kind):
    return eventually(lambda: Record.objects.filter(kind=kind).order_by("id").first())


def count(kind):
    return in_database(Record.objects.filter(kind=kind).count)


async def test_viewing_lasts_from_first_picture_to_unsubscribe(page, bridge, robot, observer):
    await look(bridge, page)
    await picture(bridge, page, 1)
    start = await found("camera.start")
    assert (start.actor_id, start.robot_id, start.parameters) == (
        str(observer.pk),
        robot.id,
        {"camera": CAMERA},
    )
    await picture(bridge, page, 2)
    await page.say("unsubscribe", topic=CAMERA)
    end = await found("camera.end")  # shorter than a second, but recorded
    assert (end.of_id, end.actor_id, end.outcome) == (start.pk, str(observer.pk), "closed")
    assert 0.0 <= end.parameters["duration_s"] < 5.0
    assert await count("camera.start") == 1


async def test_closing_the_page_ends_the_viewing(page, bridge):
    await look(bridge, page)
    await picture(bridge, page)
    await page.close()
    assert (await found("camera.end")).outcome == "closed"


async def test_losing_access_ends_the_viewing(page, bridge, observer):
    await look(bridge, page)
    await picture(bridge, page)
    await in_database(lambda: RobotRole.objects.filter(user=observer).delete())
    assert (await found("camera.end")).of_id == (await found("camera.start")).pk


async def test_samples_without_picture_are_no_viewing(page, bridge):
    await look(bridge, page)
    await picture(bridge, page, 1, type="nav_msgs/Odometry")
    await picture(bridge, page, 2, refusal=wire.Refusal("too_large", "Too large.", "robot"))
    await picture(bridge, page, 3)
    await found("camera.start")
    assert await count("camera.start") == 1


async def test_long_viewing_is_recorded_in_parts(page, bridge, monkeypatch):
    monkeypatch.setattr(camera_audit, "PART_S", 0.0)
    await look(bridge, page)
    await picture(bridge, page, 1)
    await picture(bridge, page, 2)
    assert (await found("camera.end")).outcome == "goes_on"
    await eventually(lambda: Record.objects.filter(kind="camera.start").count() == 2)


def test_viewing_left_by_a_dead_process_ends_as_unknown(robot, observer, monkeypatch):
    def watched():
        return record("camera.start", actor=observer, robot_id=robot.id, parameters={"camera": CAMERA})

    ended, left = watched(), watched()
    record("camera.end", of=ended, outcome="closed")
    later = timezone.now() + camera_audit.ABANDONED_AFTER + timedelta(seconds=1)
    call_command("run_housekeeping", "--once")
    assert not Record.objects.filter(of=left).exists()  # this viewing may still be running
    for _ in range(2):
        list(camera_audit.close_abandoned(later))
    end = Record.objects.get(of=left)
    assert (end.kind, end.outcome, end.actor_id) == ("camera.end", "unknown", None)
    assert Record.objects.filter(of=ended).count() == 1


async def test_sample_is_decoded_once_for_all_viewers(observer, robot):
    shown = wire.Sample("/odom", "nav_msgs/Odometry", 1, 5.0, 4, None, 1, {"data": [uuid4().hex]})
    message = wire.encode(shown).decode()
    before = camera_audit._camera_of.cache_info().misses
    for _ in range(3):
        camera_audit.CameraAudit(observer, robot.id, robot.name).begin_if_picture(message)
    assert camera_audit._camera_of.cache_info().misses == before + 1


async def test_frequent_viewings_delay_the_next_picture(page, bridge, robot, monkeypatch):
    monkeypatch.setattr(repeat_suppression, "RECORDS_BURST", 2.0)
    monkeypatch.setattr(repeat_suppression, "RECORDS_PER_S", 0.01)
    monkeypatch.setattr(camera_audit, "_budgets", repeat_suppression.RecordBudgets())
    for number in (1, 2):
        await look(bridge, page)
        await picture(bridge, page, number)
        await page.say("unsubscribe", topic=CAMERA)
        await bridge.hears(wire.LinkSubscribe, lambda looks: CAMERA not in looks.topics)
    await look(bridge, page)
    shown = wire.Sample(CAMERA, "sensor_msgs/CompressedImage", 3, 5.0, 4, None, 1, {"data": [1]})
    bridge.say(wire.LinkSample(CAMERA, msgspec.Raw(wire.encode(shown))))
    await page.refused("busy")
    await eventually(lambda: Record.objects.filter(kind="camera.end").count() == 2)
    assert await count("camera.start") == 2
