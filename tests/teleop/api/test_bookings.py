"""Bookings by programs: the rules of the pages, own and others' bookings, versions, pages of the list, bad input."""

from datetime import UTC, datetime, timedelta, timezone
from uuid import uuid4

import pytest
from django.utils import timezone as clock

from fleet.bookings.changes.waiting_list import keep_waiting_lists
from fleet.bookings.models import Booking, Policy, State, Waiting
from fleet.bookings.rules import Slot
from fleet.bookings.services import booking_make
from robots.access.models import Course, Enrolment
from robots.registry.models import RobotRole

pytestmark = pytest.mark.django_db


def hour(hours=0.0):
    now = clock.now().replace(minute=0, second=0, microsecond=0)
    return now + timedelta(hours=1 + hours)


def words(moment):
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def times(begins_h=1.0, hours=1.0):
    return {"starts_at": words(hour(begins_h)), "ends_at": words(hour(begins_h + hours))}


def wish(robot, begins_h=1.0, hours=1.0, **more):
    return {"robot": robot.slug, **times(begins_h, hours), **more}


def book(robot, person, begins_h=1.0):
    slot = Slot(hour(begins_h), hour(begins_h + 1))
    return booking_make(robot=robot, person=person, slot=slot, now=clock.now())


def codes(answer):
    return [refusal["code"] for refusal in answer.data["refusals"]]


@pytest.fixture
def course(robot, supervisor, stranger):
    """A course whose supervisor has no role on the robot itself, and one of its people."""
    today = clock.now().date()
    made = Course.objects.create(
        name="HRI",
        slug="hri",
        role="operator",
        starts_on=today - timedelta(days=2),
        ends_on=today + timedelta(days=30),
    )
    made.robots.add(robot)
    made.supervisors.add(supervisor)
    RobotRole.objects.filter(user=supervisor).delete()
    Enrolment.objects.create(course=made, person=stranger)
    return made


def test_a_program_books_moves_and_cancels(robot, operator, program):
    api = program(operator, "read", "book")
    made = api("POST", "/bookings", wish(robot, purpose="night test"))
    assert made.status_code == 201, made.data
    address = f"/bookings/{made.data['id']}"
    assert (made["Location"], made["ETag"]) == (f"/api/v1{address}", '"1"')
    assert made.data | {"id": ""} == {
        "id": "",
        "version": 1,
        "robot": "tiago-1",
        "person": "Olga Operator",
        "username": "operator",
        "yours": True,
        "may_change": True,
        "course": None,
        **times(),
        "held_until": times()["ends_at"],
        "stage": "booked",
        "purpose": "night test",
        "offer_until": None,
        "series": None,
        "made_at": made.data["made_at"],
        "shared": "",
        "lesson": None,
        "shared_with_you": False,
        "team": [],
        "turn_min": None,
        "record": False,
    }
    moved = api("PATCH", address, {"ends_at": words(hour(3))}, If_Match='"1"')
    assert (moved.status_code, moved["ETag"], moved.data["ends_at"]) == (200, '"2"', words(hour(3)))
    assert api("GET", address).data == moved.data
    ended = api("DELETE", f"{address}?reason=rain", If_Match='"2"')
    assert (ended.status_code, ended.data["stage"], ended.data["may_change"]) == (200, "cancelled", False)
    again = api("DELETE", address, If_Match='"3"')
    assert (again.status_code, again.data["code"]) == (409, "over")


def test_a_browser_books_as_a_program_does(robot, operator, page_of):
    assert page_of(operator)("POST", "/bookings", wish(robot)).status_code == 201


def test_an_answer_has_all_refusals_and_alternatives(robot, operator, second_operator, program):
    Policy.objects.filter(robot=None, group=None).delete()
    Policy.objects.create(robot=robot, shortest_min=30, horizon_days=1)
    book(robot, operator)
    taken = program(second_operator)("POST", "/bookings", wish(robot, 1, 0.25))
    assert taken.status_code == 409
    assert taken["Content-Type"] == "application/problem+json"
    assert (taken.data["code"], codes(taken)) == ("taken", ["taken", "too_short"])
    assert taken.data["alternatives"] == []  # none of 15 min, which is too short
    free = program(second_operator)("POST", "/bookings", wish(robot, 1, 1)).data["alternatives"]
    assert free[0] == {"robot": "tiago-1", **times(2, 1)}
    assert Booking.objects.count() == 1


def test_changes_need_the_version_that_was_read(robot, operator, program):
    api, one = program(operator), book(robot, operator)
    address = f"/bookings/{one.pk}"
    for method, path, body in (
        ("PATCH", "", {}),
        ("DELETE", "", None),
        ("POST", "/hand-over", {"to": "operator"}),
        ("POST", "/approve", None),
    ):
        answer = api(method, address + path, body)
        assert (answer.status_code, answer.data["code"]) == (428, "if_match_missing"), path
        for stale in ('"7"', 'W/"1"', "1", '"abc"'):
            answer = api(method, address + path, body, If_Match=stale)
            assert (answer.status_code, answer.data["code"]) == (412, "changed"), (path, stale)
    assert api("DELETE", address, If_Match="*").status_code == 428
    one.refresh_from_db()
    assert (one.version, one.state) == (1, State.BOOKED)


def test_own_and_others_bookings(robot, other_robot, operator, second_operator, staff, stranger, program):
    mine, theirs, hidden = book(robot, operator, 1), book(robot, second_operator, 3), book(other_robot, staff)
    api = program(operator)
    listed = {entry["id"]: entry for entry in api("GET", "/bookings").data["bookings"]}
    assert set(listed) == {str(mine.pk), str(theirs.pk)}
    assert listed[str(theirs.pk)]["person"] == "Olaf Operator"  # as in the calendar
    assert listed[str(theirs.pk)]["username"] is None
    assert listed[str(theirs.pk)]["may_change"] is False
    answer = api("DELETE", f"/bookings/{theirs.pk}", If_Match='"1"')
    assert (answer.status_code, answer.data["code"]) == (403, "not_yours")  # not 404: it is visible
    for unseen in (hidden.pk, uuid4()):
        for method, path in (("GET", ""), ("DELETE", ""), ("POST", "/approve"), ("POST", "/accept")):
            answer = api(method, f"/bookings/{unseen}{path}", If_Match='"1"')
            assert (answer.status_code, answer.data["code"]) == (404, "not_found"), path
    assert program(stranger)("GET", f"/bookings/{mine.pk}").status_code == 404
    assert program(stranger)("GET", "/bookings").data == {"bookings": [], "next": None}
    assert program(stranger)("POST", "/bookings", wish(robot)).status_code == 404


def test_a_courses_supervisor_sees_and_changes_its_bookings(
    robot, course, supervisor, operator, stranger, program
):
    inside, outside = book(robot, stranger, 1), book(robot, operator, 3)
    # A course's supervisor is supervisor of its robots, but manages only the bookings of its people.
    api = program(supervisor)
    found = api("GET", "/bookings?course=hri").data["bookings"]
    assert [(one["id"], one["course"], one["username"]) for one in found] == [
        (str(inside.pk), "hri", "stranger")
    ]
    assert api("GET", "/bookings?person=stranger").data["bookings"] == found
    assert api("GET", "/bookings?person=operator").data["bookings"] == []
    assert program(operator)("GET", "/bookings?course=hri").status_code == 404
    assert program(operator)("GET", "/bookings?person=stranger").data["bookings"] == []
    assert api("DELETE", f"/bookings/{outside.pk}", If_Match='"1"').status_code == 403
    assert api("DELETE", f"/bookings/{inside.pk}?reason=ill", If_Match='"1"').data["stage"] == "cancelled"
    for_one = api("POST", "/bookings", wish(robot, 5, person="stranger"))
    assert (for_one.status_code, for_one.data["username"]) == (201, "stranger")
    refused = api("POST", "/bookings", wish(robot, 7, person="operator"))
    assert (refused.status_code, refused.data["code"]) == (403, "not_for_others")


def test_a_token_for_one_robot_sees_and_books_only_that(robot, other_robot, staff, program):
    here, there = book(robot, staff, 1), book(other_robot, staff, 2)
    Waiting.objects.create(
        robot=other_robot, person=staff, starts_at=hour(1), ends_at=hour(2), since=clock.now()
    )
    api = program(staff, "read", "book", robots=[robot])
    assert [one["id"] for one in api("GET", "/bookings").data["bookings"]] == [str(here.pk)]
    assert api("GET", "/bookings?robot=tiago-2").status_code == 404
    assert api("GET", f"/bookings/{there.pk}").status_code == 404
    assert api("DELETE", f"/bookings/{there.pk}", If_Match='"1"').status_code == 404
    assert api("POST", "/bookings", wish(other_robot, 5)).status_code == 404
    assert api("POST", "/waiting", wish(other_robot, 1)).status_code == 404
    assert api("GET", "/waiting").data == {"waiting": []}
    assert api("GET", "/bookings/free?robot=tiago-2").status_code == 404
    assert {one["robot"] for one in api("GET", "/bookings/free?limit=20").data["slots"]} == {"tiago-1"}


def test_scopes(robot, operator, program):
    one = book(robot, operator)
    reads = [
        ("GET", "/bookings"),
        ("GET", f"/bookings/{one.pk}"),
        ("GET", "/bookings/free"),
        ("GET", "/waiting"),
    ]
    writes = [
        ("POST", "/bookings"),
        ("PATCH", f"/bookings/{one.pk}"),
        ("DELETE", f"/bookings/{one.pk}"),
        ("POST", f"/bookings/{one.pk}/hand-over"),
        ("POST", f"/bookings/{one.pk}/approve"),
        ("POST", f"/bookings/{one.pk}/accept"),
        ("POST", "/waiting"),
        ("DELETE", "/waiting/1"),
    ]
    reader, booker = program(operator, "read", "drive", "manage"), program(operator, "book", "manage")
    for method, path in writes:
        answer = reader(method, path, If_Match='"1"')
        assert (answer.status_code, answer.data["figures"]) == (403, {"scope": "book"}), path
        assert booker(method, path).data["code"] != "scope_missing"
    for method, path in reads:
        answer = booker(method, path)
        assert (answer.status_code, answer.data["figures"]) == (403, {"scope": "read"}), path
        assert reader(method, path).status_code == 200


def test_the_list_is_read_page_by_page(robot, staff, program):
    now = clock.now()
    same = hour(2)
    Booking.objects.bulk_create(
        Booking(
            robot=robot,
            person=staff,
            starts_at=same,
            ends_at=hour(3),
            held_until=same,
            state=State.CANCELLED,
            made_at=now,
        )
        for _ in range(5)
    )
    later = book(robot, staff, 6)
    api = program(staff)
    found, address = [], "/bookings?limit=2"
    for _ in range(3):
        answer = api("GET", address).data
        found += [one["id"] for one in answer["bookings"]]
        address = f"/bookings?limit=2&cursor={answer['next']}"
    assert answer["next"] is None
    assert found[0] == str(later.pk)
    assert len(set(found)) == len(found) == 6
    between = api("GET", f"/bookings?from={words(hour(5))}&to={words(hour(8))}").data["bookings"]
    assert [one["id"] for one in between] == [str(later.pk)]


@pytest.mark.parametrize(
    ("query", "says"),
    [
        ("robots=tiago-1", "unknown field robots"),
        ("limit=0", ">= 1"),
        ("limit=ten", "a whole number"),
        ("from=2026-03-02T10:00:00", "time zone"),
        ("from=yesterday", "2026-03-02T14:30:00Z"),
        ("from=12", "2026-03-02T14:30:00Z"),
        ("from=0001-01-01T00:00:00Z", "before 2000"),
        ("cursor=abc", "cursor"),
        ("cursor=WyJhIiwgImIiXQ", "cursor"),
        ("cursor=WyIyMDI2LTAxLTAxVDAwOjAwOjAwKzAwOjAwIiwgImIiXQ", "cursor"),
        ("robot=a&robot=b", "twice"),
        ("person=%00", "NUL"),
    ],
)
def test_a_query_that_does_not_fit_is_named(operator, program, query, says):
    answer = program(operator)("GET", f"/bookings?{query}")
    assert answer.status_code == 400, answer.data
    assert says in answer.data["detail"]


@pytest.mark.parametrize(
    ("change", "code", "says"),
    [
        ({"hours": 2}, "invalid", "unknown field hours"),
        ({"starts_at": "2026-03-02T10:00:00"}, "invalid", "time zone"),
        ({"starts_at": "2026-03-02 10"}, "invalid", "starts_at"),
        ({"starts_at": 12}, "invalid", "starts_at"),
        ({"starts_at": None}, "invalid", "starts_at"),
        ({"starts_at": "0001-01-01T00:00:00+14:00"}, "wrong_year", "year"),
        ({"ends_at": "9999-12-31T23:59:59-14:00"}, "wrong_year", "year"),
        ({"robot": ["tiago-1"]}, "invalid", "robot"),
        ({"robot": ""}, "invalid", "robot"),
        ({"purpose": "x" * 121}, "invalid", "purpose"),
        ({"purpose": "a\0b"}, "invalid", "NUL"),
        ({"person": "nobody"}, "not_for_others", "your own courses"),  # as for existing people
    ],
)
def test_a_body_that_does_not_fit_is_named(robot, operator, program, change, code, says):
    answer = program(operator)("POST", "/bookings", {**wish(robot), **change})
    assert (answer.status_code, answer.data["code"]) == (403 if code == "not_for_others" else 400, code)
    assert says in answer.data["detail"]
    assert Booking.objects.count() == 0


def test_a_field_twice_is_refused(robot, operator, program):
    answer = program(operator)("POST", "/bookings", b'{"robot": "a", "robot": "b"}')
    assert (answer.status_code, answer.data["code"]) == (400, "duplicate_field")


def test_times_with_an_offset_count(robot, operator, program):
    zone = timezone(timedelta(hours=5, minutes=30))
    body = wish(robot) | {"starts_at": hour(1).astimezone(zone).isoformat()}
    made = program(operator)("POST", "/bookings", body).data
    assert made["starts_at"] == words(hour(1))
    assert datetime.fromisoformat(made["made_at"]).tzinfo is not None


def test_only_who_manages_the_robot_passes_the_policy(robot, operator, supervisor, program):
    Policy.objects.create(robot=robot, shortest_min=120)
    body = wish(robot, override="open day")
    assert codes(program(operator)("POST", "/bookings", body)) == ["too_short"]
    assert program(supervisor)("POST", "/bookings", body).status_code == 201


def test_hand_over_and_approve(robot, operator, second_operator, supervisor, program):
    Policy.objects.create(robot=robot, needs_approval=True)
    api = program(operator)
    made = api("POST", "/bookings", wish(robot)).data
    assert made["stage"] == "awaiting"
    address = f"/bookings/{made['id']}"
    assert api("POST", f"{address}/approve", If_Match='"1"').status_code == 403
    approved = program(supervisor)("POST", f"{address}/approve", If_Match='"1"')
    assert (approved.status_code, approved.data["stage"], approved["ETag"]) == (200, "booked", '"2"')
    own = api("POST", f"{address}/hand-over", {"to": "operator"}, If_Match='"2"')
    assert (own.status_code, own.data["code"]) == (409, "invalid")
    nobody = api("POST", f"{address}/hand-over", {"to": "nobody"}, If_Match='"2"')
    assert nobody.data["code"] == "no_colleague"
    asked = api("POST", f"{address}/hand-over", {"to": "second"}, If_Match='"2"')
    assert (asked.data["to"], asked.data["link"]) == ("Olaf Operator", None)
    assert api("GET", address).data["yours"]
    colleague = program(second_operator)
    [offer] = colleague("GET", "/hand-offers").data["offers"]
    assert api("POST", f"/hand-offers/{offer['id']}/accept").data["code"] == "offer_over"
    assert colleague("POST", f"/hand-offers/{offer['id']}/accept").data["yours"]
    assert colleague("GET", "/hand-offers").data["offers"] == []
    handed = api("GET", address)
    assert (handed.data["person"], handed.data["yours"]) == ("Olaf Operator", False)
    assert api("PATCH", address, times(3), If_Match='"3"').status_code == 403


def test_a_team_is_asked(robot, operator, second_operator, program):
    made = program(operator)("POST", "/bookings", wish(robot, team=["second"], turn_min=10))
    assert (made.status_code, made.data["shared"], made.data["team"]) == (201, "people", [])
    colleague = program(second_operator)
    [offer] = colleague("GET", "/hand-offers").data["offers"]
    assert (offer["share"], offer["booking"]) == (True, made.data["id"])
    joined = colleague("POST", f"/hand-offers/{offer['id']}/accept").data
    assert (joined["yours"], joined["shared_with_you"]) == (False, True)


def test_wait_accept_and_leave(robot, operator, second_operator, program):
    held = book(robot, operator)
    api = program(second_operator)
    free = api("POST", "/waiting", wish(robot, 5))
    assert (free.status_code, free.data["code"]) == (409, "free")
    assert api("POST", "/waiting", wish(robot, course="none")).status_code == 404
    joined = api("POST", "/waiting", wish(robot, purpose="night test", record=True))
    assert (joined.status_code, joined.data["purpose"], joined.data["course"]) == (201, "night test", None)
    assert joined.data["record"]
    assert joined["Location"] == f"/api/v1/waiting/{joined.data['number']}"
    other = book(robot, operator, 7)
    left = api("POST", "/waiting", wish(robot, 7)).data
    assert [one["number"] for one in api("GET", "/waiting").data["waiting"]] == [
        joined.data["number"],
        left["number"],
    ]
    assert program(operator)("DELETE", f"/waiting/{left['number']}").status_code == 404
    assert api("DELETE", f"/waiting/{left['number']}").status_code == 204
    assert api("DELETE", f"/waiting/{left['number']}").status_code == 404
    assert api("GET", "/waiting/1").status_code == 405
    program(operator)("DELETE", f"/bookings/{held.pk}", If_Match='"1"')
    keep_waiting_lists(clock.now())
    [offer] = api("GET", "/bookings?person=me").data["bookings"]
    assert (offer["stage"], offer["purpose"], offer["record"]) == ("offered", "night test", True)
    assert offer["offer_until"]
    assert program(operator)("POST", f"/bookings/{offer['id']}/accept").data["code"] == "offer_over"
    assert api("POST", f"/bookings/{offer['id']}/accept").data["stage"] == "booked"
    assert Booking.objects.get(pk=other.pk).state == State.BOOKED


def test_a_place_in_line_for_control_is_not_left_here(robot, operator, program):
    line = Waiting.objects.create(robot=robot, person=operator, since=clock.now())
    assert program(operator)("DELETE", f"/waiting/{line.pk}").status_code == 404
    assert Waiting.objects.exists()


def test_free_slots_are_those_of_the_rules(robot, operator, second_operator, observer, program):
    book(robot, second_operator, 1)
    api = program(operator)
    found = api("GET", f"/bookings/free?minutes=60&after={words(hour(1))}&robot=tiago-1").data["slots"]
    assert found[0] == {"robot": "tiago-1", **times(2)}
    assert len(found) == 3
    assert api("GET", "/bookings/free?profile=none").data == {"slots": []}
    assert program(observer)("GET", "/bookings/free").data == {"slots": []}
    assert api("GET", "/bookings/free?minutes=0").status_code == 400
