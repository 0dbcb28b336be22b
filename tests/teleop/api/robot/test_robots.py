"""REST: robots, their state, stop, speech; errors are refusals."""

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext

from fleet.audit.models import Content
from fleet.audit.services import record
from robots.bridge.drive.drive_input import velocity_of
from robots.registry.configuration import robot_config
from robots.registry.models import Phrase, RobotRole
from robots.shared import wire
from teleop.api.v1 import events
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.robot.control import VelocityRequest, _velocity
from teleop.background.database import in_database

pytestmark = pytest.mark.django_db(transaction=True)


def get(browser, address):
    return in_database(lambda: browser.get(address))


def post(browser, address):
    return in_database(lambda: browser.post(address, content_type="application/json"))


async def test_list_names_the_robots_the_person_may_see(browsers, robot, other_robot):
    answer = await get(browsers["operator"], "/api/v1/robots")
    assert [(entry["slug"], entry["role"]) for entry in answer.json()["robots"]] == [("tiago-1", "operator")]
    assert len((await get(browsers["staff"], "/api/v1/robots")).json()["robots"]) == 2


def test_list_reads_roles_once_for_any_number_of_robots(operator, robot, other_robot, signed_in):
    RobotRole.objects.create(user=operator, robot=other_robot, role="observer")
    with CaptureQueriesContext(connection) as asked:
        answer = signed_in(operator).get("/api/v1/robots").json()["robots"]
    assert [entry["role"] for entry in answer] == ["operator", "observer"]
    roles = [query for query in asked if "robots_robotrole" in query["sql"]]
    assert len(roles) == 1


async def test_robot_address_returns_its_state(browsers, robot, bridge):
    answer = (await get(browsers["observer"], f"/api/v1/robots/{robot.slug}")).json()
    assert answer["state"]["phase"] == "online"
    assert answer["facts"]["slug"] == robot.slug
    assert (answer["holder"], answer["refusal"]) == (None, None)


async def test_robot_address_says_why_the_state_is_unknown(browsers, robot):
    answer = (await get(browsers["observer"], f"/api/v1/robots/{robot.slug}")).json()
    assert answer["state"] is None
    assert answer["refusal"]["code"] == "bridge_down"


@pytest.mark.parametrize("steering", ["turn", "car"])
@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("forward_mps", [-0.1, 0.05])
def test_the_bridge_reads_the_velocity_that_was_asked_for(robot, forward_mps, share, steering):
    robot.max_share, robot.profile.reverse_steering = share, steering
    asked = VelocityRequest(forward_mps=forward_mps, turn_radps=0.1)
    sent = _velocity(robot, asked)
    drive = wire.Drive(1, 1, 0.0, sent.x, sent.w, sent.y, share=sent.share)
    read = velocity_of(drive, robot_config.of(robot).gate.limits, share, steering)
    assert read == pytest.approx((forward_mps, 0.0, 0.1))


def test_a_lesson_lowers_the_velocity_that_a_program_may_ask_for(robot):
    sent = _velocity(robot, VelocityRequest(forward_mps=0.1), 0.3)
    drive = wire.Drive(1, 1, 0.0, sent.x, sent.w, sent.y, share=sent.share)
    limits = robot_config.of(robot).gate.limits
    assert velocity_of(drive, limits, 0.3, "turn").vx == pytest.approx(0.1)
    with pytest.raises(Problem, match="takes at most"):
        _velocity(robot, VelocityRequest(forward_mps=0.31 * limits.forward_mps), 0.3)


def test_no_velocity_backwards_is_beyond_the_robots_limit(robot):
    robot.max_share = 0.5
    _velocity(robot, VelocityRequest(forward_mps=-0.2))
    with pytest.raises(Problem, match=r"at most 0\.20"):
        _velocity(robot, VelocityRequest(forward_mps=-0.21))


def test_the_head_of_the_events_ends_at_once(operator, robot, signed_in):
    answer = signed_in(operator).head("/api/v1/events")
    assert (answer.status_code, answer.content, len(events._places._taken)) == (200, b"", 0)


async def test_rest_stops_one_robot(browsers, robot, bridge):
    answer = await post(browsers["observer"], f"/api/v1/robots/{robot.slug}/stop/")
    assert answer.status_code == 200
    assert (await bridge.hears(wire.LinkStop)).by == "Obi Observer"


async def test_rest_stops_all_robots(browsers, robot, bridge):
    assert (await post(browsers["observer"], "/api/v1/stop/")).status_code == 200
    await bridge.hears(wire.LinkStop)


async def test_stop_all_names_a_robot_out_of_reach(browsers, robot):
    answer = await post(browsers["observer"], "/api/v1/stop/")
    assert answer.status_code == 202
    result = answer.json()["robots"][robot.slug]
    assert (result["pending"], result["code"], result["figures"]) == (
        True,
        "pending",
        {"because": "bridge_down"},
    )
    shown = (await get(browsers["observer"], f"/api/v1/robots/{robot.slug}")).json()
    assert (shown["pending_stop"]["by"], shown["pending_stop"]["reason"]) == ("Obi Observer", "")


async def test_unknown_robot_gets_a_refusal(browsers, robot):
    answer = await get(browsers["stranger"], f"/api/v1/robots/{robot.slug}")
    assert answer.status_code == 404
    assert answer.json()["code"] == "not_found"
    assert "may not see" in answer.json()["detail"]


async def test_unknown_address_gets_a_refusal(client, browsers):
    for address in ("/api/", "/api/v1/robot", "/api/v1/robots/tiago-1/nothing"):
        answer = await get(browsers["operator"], address)
        assert (answer.status_code, answer.json()["code"]) == (404, "not_found"), address
        assert "address" in answer.json()["detail"]
    assert (await post(browsers["operator"], "/api/v1/stops")).json()["code"] == "not_found"
    assert (await get(client, "/api/v1/robot")).status_code == 401


async def test_address_with_a_last_slash_redirects(browsers):
    answer = await get(browsers["operator"], "/api/v1/robots/")
    assert (answer.status_code, answer["location"]) == (308, "/api/v1/robots")


async def test_wrong_method_gets_a_refusal(browsers):
    answer = await post(browsers["operator"], "/api/v1/robots")
    assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed")


async def test_signed_out_request_gets_401(client, robot):
    answer = await get(client, "/api/v1/robots")
    assert (answer.status_code, answer.json()["code"]) == (401, "signed_out")
    assert answer.json()["rule"] == "account"


def said(robot, who, text, outcome=None):
    """Record a spoken text with its outcome."""
    facts = {"language": "en-GB", "topic": "/tts"}
    start = record(
        "speech.start", actor=who, robot_id=robot.id, robot_name=robot.name, parameters=facts, text=text
    )
    if outcome:
        record("speech.end", actor=who, of=start, outcome=outcome, private={"words": "Why."})
    return start.pk


async def spoken(browser, robot, query=""):
    return (await get(browser, f"/api/v1/robots/{robot.slug}/speech/history{query}")).json()


async def test_phrases_of_the_profile_come_before_the_robots_own(browsers, robot, other_robot):
    await in_database(
        Phrase.objects.create, robot=robot, text="I am number one.", language="en-GB", tags="own, me"
    )
    await in_database(Phrase.objects.create, robot=other_robot, text="I am not.", language="en-GB")
    answer = (await get(browsers["observer"], f"/api/v1/robots/{robot.slug}/phrases")).json()["phrases"]
    assert len(answer) == 25
    assert answer[0]["text"] == "Hello! It is nice to meet you."
    number = answer[-1].pop("id")
    assert isinstance(number, int)
    assert answer[-1] == {"text": "I am number one.", "language": "en-GB", "tags": ["own", "me"]}


async def test_phrases_of_an_invisible_robot_are_refused(browsers, robot):
    assert (await get(browsers["stranger"], f"/api/v1/robots/{robot.slug}/phrases")).status_code == 404
    assert (await get(browsers["stranger"], f"/api/v1/robots/{robot.slug}/speech/history")).status_code == 404


async def test_expired_text_leaves_its_entry_in_the_history(browsers, robot, operator):
    number = await in_database(said, robot, operator, "Hola", "done")
    await in_database(lambda: Content.objects.all().delete())
    (entry,) = (await spoken(browsers["operator"], robot))["entries"]
    assert (entry["number"], entry["text"], entry["language"], entry["outcome"]) == (
        number,
        "",
        "en-GB",
        "done",
    )


async def test_history_is_newest_first_with_outcomes(browsers, robot, operator):
    first = await in_database(said, robot, operator, "Hola", "done")
    second = await in_database(said, robot, operator, "Adiós")
    answer = await spoken(browsers["operator"], robot)
    assert answer["more"] is False
    assert [entry["number"] for entry in answer["entries"]] == [second, first]
    newest, oldest = answer["entries"]
    assert (newest["outcome"], newest["why"]) == (None, "")
    del oldest["at"]
    assert oldest == {
        "number": first,
        "text": "Hola",
        "language": "en-GB",
        "topic": "/tts",
        "who": "Olga Operator",
        "outcome": "done",
        "why": "Why.",
    }


async def test_only_supervisors_and_staff_see_others_speech(
    browsers, robot, other_robot, operator, second_operator
):
    await in_database(said, robot, operator, "mine")
    await in_database(said, robot, second_operator, "theirs")
    await in_database(said, other_robot, operator, "elsewhere")
    for who, texts in {
        "operator": ["mine"],
        "second": ["theirs"],
        "observer": [],
        "supervisor": ["theirs", "mine"],
        "staff": ["theirs", "mine"],
    }.items():
        answer = await spoken(browsers[who], robot)
        assert [entry["text"] for entry in answer["entries"]] == texts, who


async def test_history_is_read_page_by_page(browsers, robot, operator):
    numbers = [await in_database(said, robot, operator, f"Text {number}") for number in range(5)]
    newest = await spoken(browsers["operator"], robot, "?limit=2")
    assert [entry["number"] for entry in newest["entries"]] == numbers[:2:-1]
    assert newest["more"] is True
    rest = await spoken(browsers["operator"], robot, f"?limit=3&before={numbers[3]}")
    assert [entry["number"] for entry in rest["entries"]] == numbers[2::-1]
    assert rest["more"] is False


@pytest.mark.parametrize(
    "query", ["limit=0", "limit=201", "limit=ten", "before=-1", "before=9223372036854775808"]
)
async def test_invalid_page_parameters_get_a_refusal(browsers, robot, query):
    answer = await get(browsers["operator"], f"/api/v1/robots/{robot.slug}/speech/history?{query}")
    assert (answer.status_code, answer.json()["code"]) == (400, "invalid")
    assert "must be a whole number from 1 to" in answer.json()["detail"]
