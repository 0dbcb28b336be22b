"""REST: the robots, how they are, the stop; refusals explain themselves."""

import pytest

from robots import wire
from teleop.database import in_database

pytestmark = pytest.mark.django_db(transaction=True)


def get(browser, address):
    return in_database(lambda: browser.get(address))


def post(browser, address):
    return in_database(lambda: browser.post(address, content_type="application/json"))


async def test_the_list_names_the_robots_that_one_may_see(browsers, robot, other_robot):
    answer = await get(browsers["operator"], "/api/robots/")
    assert [(entry["slug"], entry["role"]) for entry in answer.json()] == [("tiago-1", "operator")]
    assert len((await get(browsers["staff"], "/api/robots/")).json()) == 2


async def test_a_robots_own_address_tells_how_it_is(browsers, robot, bridge):
    answer = (await get(browsers["observer"], f"/api/robots/{robot.slug}/")).json()
    assert answer["state"]["phase"] == "online"
    assert answer["facts"]["slug"] == robot.slug
    assert (answer["holder"], answer["refusal"]) == (None, None)


async def test_or_why_that_is_not_known(browsers, robot):
    answer = (await get(browsers["observer"], f"/api/robots/{robot.slug}/")).json()
    assert answer["state"] is None
    assert answer["refusal"]["code"] == "bridge_down"


async def test_the_stop_by_rest(browsers, robot, bridge):
    answer = await post(browsers["observer"], f"/api/robots/{robot.slug}/stop/")
    assert answer.status_code == 200
    assert (await bridge.hears(wire.LinkStop)).by == "Obi Observer"


async def test_stop_all_by_rest(browsers, robot, bridge):
    assert (await post(browsers["observer"], "/api/stop/")).status_code == 200
    await bridge.hears(wire.LinkStop)


async def test_a_robot_that_was_not_reached_is_named(browsers, robot):
    answer = await post(browsers["observer"], "/api/stop/")
    assert answer.status_code == 502
    assert answer.json()["robots"][robot.slug]["code"] == "bridge_down"


async def test_what_is_not_there_is_explained(browsers, robot):
    answer = await get(browsers["stranger"], f"/api/robots/{robot.slug}/")
    assert answer.status_code == 404
    assert answer.json()["code"] == "not_found"
    assert "may not see" in answer.json()["text"]


async def test_a_wrong_method_is_explained(browsers):
    answer = await post(browsers["operator"], "/api/robots/")
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")


async def test_whoever_is_not_signed_in_is_told_so(client, robot):
    answer = await get(client, "/api/robots/")
    assert answer.status_code in (401, 403)
    assert answer.json()["rule"] == "account"
