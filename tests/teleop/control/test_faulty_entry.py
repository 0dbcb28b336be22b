"""A robot whose entry contradicts its changed profile cannot be driven; its pages show why; other robots work."""

import pytest

from robots.registry.models import Robot, RobotProfile
from robots.shared import wire
from teleop.background.database import in_database
from tests.teleop.support import Page

pytestmark = pytest.mark.django_db(transaction=True)

WHY = "scans: 1 here, 2 in the profile"


@pytest.fixture
def own_lasers(robot, other_robot):
    """`robot` has its own list of lasers, which no longer fits the profile; `other_robot` uses the profile's."""
    robot.overrides = {"topics": {"scans": robot.profile.topics["scans"]}}
    robot.full_clean()
    robot.save()


def gain_a_laser():
    profile = RobotProfile.objects.get(slug="tiago")
    profile.topics["scans"].append({"topic": "/scan_rear", "pose": [-0.2, 0.0, 3.14]})
    profile.full_clean()
    profile.save()


async def test_pages_of_robot_and_fleet_open(own_lasers, browsers, robot, other_robot):
    await in_database(gain_a_laser)
    for address in ("/", f"/robots/{robot.slug}/", f"/robots/{other_robot.slug}/"):
        page = await in_database(browsers["staff"].get, address)
        assert page.status_code == 200, address


async def test_page_shows_the_reason_and_can_stop_the_robot(own_lasers, open_page, bridge):
    await in_database(gain_a_laser)
    page = await open_page("operator")
    assert page.control["refusal"]["code"] == "robot_misdescribed"
    assert WHY in page.control["refusal"]["text"]
    await page.say("take")
    await page.refused("robot_misdescribed")
    assert not bridge.all(wire.Grant)
    await page.say("stop")
    await bridge.hears(wire.LinkStop)


async def test_page_shows_the_reason_without_a_bridge(own_lasers, open_page, bridge):
    await in_database(gain_a_laser)
    await bridge.close()
    page = await open_page("operator")
    gone = await page.hears("bridge_gone")
    assert WHY in gone["refusal"]["text"]


async def test_holder_loses_control_with_that_reason(own_lasers, open_page, bridge):
    page = await open_page("operator")
    await page.say("take")
    await page.hears("control", state="yours")
    await in_database(gain_a_laser)
    await bridge.hears(wire.Revoke)
    assert WHY in (await page.hears("notice", code="robot_misdescribed"))["text"]


async def test_fleet_card_shows_the_reason_others_their_own(
    own_lasers, browsers, websocket_headers, robot, other_robot
):
    await in_database(gain_a_laser)
    page = await Page(websocket_headers(browsers["staff"]), "/ws/fleet/").open()
    cards = (await page.hears("fleet"))["robots"]
    assert WHY in cards[robot.slug]["refusal"]["text"]
    assert cards[other_robot.slug]["refusal"]["code"] == "bridge_down"
    await page.close()


async def test_another_robot_of_the_profile_can_be_driven(own_lasers, open_page, browsers, other_robot):
    await in_database(gain_a_laser)
    page = await open_page("staff", slug=other_robot.slug)
    assert page.control["refusal"] is None
    assert len(page.welcome["robot"]["sonars"]) == 3


async def test_rest_shows_the_reason(own_lasers, browsers, robot):
    await in_database(gain_a_laser)
    listed = await in_database(browsers["operator"].get, "/api/v1/robots")
    assert listed.status_code == 200
    one = (await in_database(browsers["operator"].get, f"/api/v1/robots/{robot.slug}")).json()
    assert one["refusal"]["code"] == "robot_misdescribed"
    assert one["facts"]["limits"]["forward_mps"] == 1.0


async def test_unreadable_entry_breaks_no_page(open_page, robot):
    await in_database(lambda: Robot.objects.update(overrides={"limits": "fast"}))
    page = await open_page("operator")
    assert "limits: Expected an object" in page.control["refusal"]["text"]
