"""Control sessions and the log by programs: staff read all, other people only their own."""

import json
from datetime import timedelta
from uuid import uuid4

import pytest
from django.utils import timezone as clock

from fleet.audit.models import Record
from fleet.audit.services import record
from robots.registry.models import RobotRole
from teleop.api.v1.framework.cursors import encoded
from teleop.models import ControlSession

pytestmark = pytest.mark.django_db


def session_of(robot, person, fence, *, hours_ago=1, ended=True):
    begins = clock.now() - timedelta(hours=hours_ago)
    return ControlSession.objects.create(
        robot=robot,
        user=person,
        fence=fence,
        started_at=begins,
        ended_at=begins + timedelta(minutes=5) if ended else None,
        end_reason="released" if ended else "",
    )


def said(robot, who, text, session=None):
    """Record a spoken text and its outcome; return the number of the request."""
    facts = {"language": "en-GB", "topic": "/tts"}
    start = record(
        "speech.start",
        actor=who,
        robot_id=robot.id,
        robot_name=robot.name,
        parameters=facts,
        text=text,
        session_id=session.pk if session else None,
        fence=session.fence if session else None,
    )
    record("speech.end", actor=who, of=start, outcome="done")
    return start.pk


@pytest.fixture
def sessions(robot, other_robot, operator, second_operator, staff):
    """A session of the operator, one of a colleague on the same robot, and one of staff on another."""
    return [
        session_of(robot, operator, 1, hours_ago=3),
        session_of(robot, second_operator, 2, hours_ago=2),
        session_of(other_robot, staff, 1, hours_ago=1, ended=False),
    ]


def listed(answer):
    assert answer.status_code == 200, answer.data
    return [one["id"] for one in answer.data["sessions"]]


def numbers(answer):
    assert answer.status_code == 200, answer.data
    return [one["number"] for one in answer.data["records"]]


@pytest.mark.parametrize(
    ("who", "seen"),
    [
        ("operator", [0]),
        ("second_operator", [1]),
        ("observer", []),
        ("supervisor", [1, 0]),
        ("staff", [2, 1, 0]),
    ],
)
def test_sessions_are_seen_as_on_the_pages(sessions, program, request, who, seen):
    api = program(request.getfixturevalue(who), "read")
    assert listed(api("GET", "/sessions")) == [str(sessions[number].pk) for number in seen]
    for number, session in enumerate(sessions):
        answer = api("GET", f"/sessions/{session.pk}")
        assert answer.status_code == (200 if number in seen else 404), number
    assert api("GET", f"/sessions/{uuid4()}").status_code == 404


def test_own_sessions_stay_when_the_role_is_gone(sessions, operator, program):
    RobotRole.objects.filter(user=operator).delete()
    api = program(operator)
    assert len(listed(api("GET", "/sessions"))) == 1
    assert len(listed(api("GET", "/sessions?robot=tiago-1"))) == 1
    assert api("GET", "/sessions?robot=tiago-2").status_code == 404


def test_sessions_are_filtered_and_read_page_by_page(sessions, staff, program):
    api = program(staff)
    keys = [str(session.pk) for session in sessions]
    assert listed(api("GET", "/sessions?robot=tiago-1")) == [keys[1], keys[0]]
    assert listed(api("GET", "/sessions?person=operator")) == [keys[0]]
    assert listed(api("GET", "/sessions?person=me&state=open")) == [keys[2]]
    since = (clock.now() - timedelta(hours=2.5)).strftime("%Y-%m-%dT%H:%M:%SZ")
    assert listed(api("GET", f"/sessions?from={since}&state=ended")) == [keys[1]]
    assert listed(api("GET", f"/sessions?to={since}")) == [keys[0]]
    found, address = [], "/sessions?limit=1"
    for _ in range(3):
        answer = api("GET", address)
        found += listed(answer)
        address = f"/sessions?limit=1&cursor={answer.data['next']}"
    assert (found, answer.data["next"]) == (keys[::-1], None)


def test_a_session_tells_what_happened_in_it(robot, operator, sessions, program):
    said(robot, operator, "Hello there", sessions[0])
    read = program(operator)("GET", f"/sessions/{sessions[0].pk}").data
    assert (read["robot"], read["person"], read["yours"], read["end_reason"]) == (
        "tiago-1",
        "Olga Operator",
        True,
        "released",
    )
    assert read["figures"]["lasted_s"] == 300.0
    [event] = read["events"]
    assert event["subject"] == "Hello there"


def test_people_read_their_own_records_and_staff_all(robot, operator, second_operator, staff, program):
    mine, theirs = said(robot, operator, "mine"), said(robot, second_operator, "theirs")
    api = program(operator, "read")
    entry = next(one for one in api("GET", "/audit?kind=speech.start").data["records"])
    assert numbers(api("GET", "/audit?kind=speech.start")) == [mine]
    assert (entry["details"]["text"], entry["outcome"], entry["ended"]["kind"]) == (
        "mine",
        "done",
        "speech.end",
    )
    assert (entry["robot"]["name"], entry["person"]["name"]) == ("TIAGo 1", "Olga Operator")
    assert entry["at"].endswith("Z")
    assert api("GET", f"/audit/{mine}").data == entry
    assert api("GET", f"/audit/{entry['ended']['number']}").data == entry
    assert api("GET", f"/audit/{theirs}").status_code == 404
    assert api("GET", "/audit?person=second").status_code == 404
    assert api("GET", f"/audit?person={second_operator.pk}").status_code == 404
    assert numbers(program(staff)("GET", "/audit?kind=speech.start")) == [theirs, mine]


def test_records_are_filtered(robot, other_robot, operator, staff, program):
    here, there = said(robot, operator, "good morning"), said(other_robot, staff, "good night")
    api = program(staff)
    for query, expected in {
        "robot=tiago-1": [here],
        "person=operator": [here],
        "person=me": [there],
        "outcome=done": [there, here],
        "q=morning": [here],
        "since=2020-01-01&until=2020-01-02": [],
        f"since={clock.now().date()}": [there, here],
        f"session={uuid4()}": [],
        "person=console": [],
    }.items():
        answer = api("GET", f"/audit?kind=speech.start&{query}")
        assert numbers(answer) == expected, query
    assert numbers(api("GET", "/audit?robot=none&kind=speech.start")) == []
    assert api("GET", "/audit?person=nobody").status_code == 404
    assert api("GET", "/audit?robot=nothing").status_code == 404


def test_records_are_read_page_by_page(robot, operator, program):
    expected = [said(robot, operator, f"text {number}") for number in range(5)][::-1]
    api, found, cursor = program(operator), [], ""
    for _ in range(3):
        answer = api("GET", f"/audit?kind=speech.start&limit=2{cursor}")
        found += numbers(answer)
        cursor = f"&cursor={answer.data['next']}"
    assert (found, answer.data["next"]) == (expected, None)


def test_a_token_for_one_robot_reads_only_that(robot, other_robot, sessions, staff, program):
    here, there = said(robot, staff, "here"), said(other_robot, staff, "there")
    api = program(staff, "read", robots=[robot])
    assert listed(api("GET", "/sessions")) == [str(sessions[1].pk), str(sessions[0].pk)]
    assert api("GET", f"/sessions/{sessions[2].pk}").status_code == 404
    assert numbers(api("GET", "/audit?kind=speech.start")) == [here]
    assert api("GET", "/audit?robot=tiago-2").status_code == 404
    assert api("GET", "/audit?robot=none").status_code == 404
    assert api("GET", f"/audit/{there}").status_code == 404
    assert api("GET", f"/audit/{Record.objects.filter(robot_id=None).first().pk}").status_code == 404
    both = program(staff, "read", robots=[robot, other_robot])
    answer = both("GET", "/audit")
    assert (answer.status_code, answer.data["code"]) == (400, "robot_needed")
    assert numbers(both("GET", "/audit?robot=tiago-2&kind=speech.start")) == [there]


def test_each_needs_the_scope(sessions, staff, program):
    api = program(staff, "drive", "speak", "motions", "topics", "book", "manage")
    for method, path in (
        ("GET", "/sessions"),
        ("GET", f"/sessions/{sessions[0].pk}"),
        ("GET", "/audit"),
        ("GET", "/audit/1"),
        ("POST", "/audit/export"),
    ):
        answer = api(method, path)
        assert (answer.status_code, answer.data["figures"]) == (403, {"scope": "read"}), path


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("/sessions?robots=a", "unknown field robots"),
        ("/sessions?state=shut", "state: Invalid value 'shut'"),
        ("/sessions?from=2026-01-01T00:00:00", "time zone"),
        ("/sessions?cursor=WzFd", "cursor"),
        ("/audit?who=me", "unknown field who"),
        ("/audit?since=yesterday", "since"),
        ("/audit?session=7", "UUID"),
        ("/audit?cursor=WyJhIl0", "cursor"),
        ("/audit?cursor=%C3%A4", "cursor"),
        (f"/sessions?cursor={encoded('0001-01-01T00:00:00+14:00', str(uuid4()))}", "cursor"),
        (f"/bookings?cursor={encoded('9999-12-31T23:00:00-14:00', str(uuid4()))}", "cursor"),
        (f"/bookings?cursor={encoded('2026-01-01T00:00:00Z', 'x')}", "cursor"),
        ("/events?after=x", "after"),
        ("/events?robots=a", "unknown field robots"),
        ("/audit?q=%00", "NUL"),
        ("/audit?limit=-1", "limit"),
    ],
)
def test_a_query_that_does_not_fit_is_named(operator, program, path, says):
    answer = program(operator)("GET", path)
    assert answer.status_code == 400, answer.data
    assert says in answer.data["detail"]


@pytest.mark.django_db(transaction=True)
@pytest.mark.filterwarnings("ignore:StreamingHttpResponse must consume:Warning")
def test_staff_export_what_they_filter_and_others_nothing(robot, operator, staff, program):
    mine = said(robot, operator, "mine")
    refused = program(operator)("POST", "/audit/export")
    assert (refused.status_code, refused.data["code"]) == (403, "permission_denied")
    answer = program(staff).stream("POST", "/audit/export?kind=speech.start")
    assert answer["Content-Type"].startswith("application/jsonl")
    [line] = [json.loads(line) for line in b"".join(answer).splitlines()]
    assert (line["number"], line["details"]["text"]) == (mine, "mine")
    assert Record.objects.filter(kind="audit.export", actor=str(staff.pk)).exists()
    assert program(staff)("GET", "/audit/export").status_code == 405
