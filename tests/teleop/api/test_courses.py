"""Courses by programs: people who manage a course can change its people, others get "not found"."""

from datetime import timedelta

import pytest

from fleet.accounts.models import User
from robots.access.models import Course, Enrolment, Qualification, QualificationGrant
from robots.access.selectors import lab_date

pytestmark = pytest.mark.django_db


def make_course(slug, robot, *supervisors):
    course = Course.objects.create(
        name=slug.upper(),
        slug=slug,
        role="operator",
        starts_on=lab_date(),
        ends_on=lab_date() + timedelta(days=30),
        week_min=120,
    )
    course.robots.add(robot)
    course.supervisors.set(supervisors)
    return course


@pytest.fixture
def hri(robot, second_operator, stranger):
    """A course that `second_operator` supervises."""
    course = make_course("hri", robot, second_operator)
    Enrolment.objects.create(course=course, person=stranger)
    return course


@pytest.fixture
def arms(other_robot):
    """A course that only staff manage."""
    return make_course("arms", other_robot)


@pytest.fixture
def induction(robot):
    found = Qualification.objects.create(name="Safety induction", slug="induction")
    found.robots.add(robot)
    return found


def every(slug):
    """Every operation on a course."""
    return [
        ("GET", f"/courses/{slug}", None),
        ("GET", f"/courses/{slug}/members", None),
        ("POST", f"/courses/{slug}/members", {"list": "Ada <ada@example.org>"}),
        ("DELETE", f"/courses/{slug}/members/stranger", None),
        ("POST", f"/courses/{slug}/qualifications/induction/grant", {"people": None}),
        ("POST", f"/courses/{slug}/qualifications/induction/revoke", {"people": None}),
    ]


def test_a_supervisor_lists_and_reads_own_courses(hri, arms, induction, second_operator, staff, program):
    api = program(second_operator, "manage")
    [entry] = api("GET", "/courses").data["courses"]
    assert (entry["slug"], entry["people"], entry["valid"]) == ("hri", 1, True)
    read = api("GET", "/courses/hri").data
    assert read == {
        **entry,
        "robots": ["tiago-1"],
        "groups": [],
        "supervisors": ["Olaf Operator"],
        "quotas": {"day_min": None, "week_min": 120, "at_once": None, "course_week_min": None},
        "lessons_count": "nobody",
        "record_lessons": False,
        "qualifications": [{"slug": "induction", "name": "Safety induction"}],
    }
    assert {one["slug"] for one in program(staff)("GET", "/courses").data["courses"]} == {"hri", "arms"}


@pytest.mark.parametrize("who", ["operator", "stranger", "supervisor", "observer"])
def test_others_find_nothing(hri, induction, program, who, request):
    api = program(request.getfixturevalue(who))
    assert api("GET", "/courses").data == {"courses": []}
    for method, path, body in every("hri"):
        answer = api(method, path, body)
        assert (answer.status_code, answer.data["code"]) == (404, "not_found"), path
    assert Enrolment.objects.count() == 1


def test_a_supervisor_finds_no_course_of_others(hri, arms, induction, second_operator, program):
    for method, path, body in (*every("arms"), *every("nothing")):
        assert program(second_operator)(method, path, body).status_code == 404, path


def test_each_needs_the_scope(hri, induction, second_operator, program):
    api = program(second_operator, "read", "book", "drive")
    for method, path, body in (("GET", "/courses", None), *every("hri")):
        answer = api(method, path, body)
        assert (answer.status_code, answer.data["figures"]) == (403, {"scope": "manage"}), path


def test_a_browser_manages_as_a_program_does(hri, second_operator, page_of):
    assert page_of(second_operator)("GET", "/courses/hri/members").status_code == 200


def test_a_token_for_one_robot_manages_only_its_courses(
    hri, arms, induction, robot, other_robot, staff, program
):
    api = program(staff, "manage", robots=[robot])
    assert [one["slug"] for one in api("GET", "/courses").data["courses"]] == ["hri"]
    for method, path, body in every("arms"):
        assert api(method, path, body).status_code == 404, path
    induction.robots.add(other_robot)
    assert api("GET", "/courses/hri").data["qualifications"] == []
    refused = api("POST", "/courses/hri/qualifications/induction/grant", {"people": None})
    assert (refused.status_code, refused.data["code"]) == (403, "other_robots")
    hri.robots.add(other_robot)
    assert api("GET", "/courses/hri").status_code == 404


def test_people_are_enrolled_by_a_list_after_a_preview(hri, second_operator, operator, program):
    operator.email = "olga@example.org"
    operator.save()
    api = program(second_operator)
    people = "Olga <olga@example.org>\nAda Lovelace, ada@example.org\nnobody at all\n"
    seen = api("POST", "/courses/hri/members", {"list": people, "preview": True}).data
    assert (seen["enrolled"], Enrolment.objects.count()) == (0, 1)
    done = api("POST", "/courses/hri/members", {"list": people}).data
    assert done == {**seen, "enrolled": 2}
    assert (done["known"], done["new"]) == ([], [])  # else a supervisor would learn who has an account
    assert done["undisclosed"] == [
        {"name": "Olga", "email": "olga@example.org", "number": ""},
        {"name": "Ada Lovelace", "email": "ada@example.org", "number": ""},
    ]
    assert [one["line"] for one in done["wrong"]] == [3]
    again = api("POST", "/courses/hri/members", {"list": people}).data
    assert (again["enrolled"], len(again["already"])) == (0, 2)
    members = api("GET", "/courses/hri/members").data["members"]
    assert [one["name"] for one in members] == ["Ada Lovelace", "Olga Operator", "Stig Stranger"]


def test_a_person_is_taken_out(hri, second_operator, program):
    api = program(second_operator)
    assert api("DELETE", "/courses/hri/members/stranger").status_code == 204
    again = api("DELETE", "/courses/hri/members/stranger")
    assert (again.status_code, again.data["detail"]) == (404, "stranger is not in HRI.")
    assert api("DELETE", "/courses/hri/members/operator").status_code == 404
    assert User.objects.filter(username="stranger").exists()


def test_a_qualification_is_granted_and_revoked(hri, induction, second_operator, program):
    api, address = program(second_operator), "/courses/hri/qualifications/induction"
    day = lab_date() + timedelta(days=10)
    body = {"people": ["stranger"], "last_day": day.isoformat()}
    assert api("POST", f"{address}/grant", body).data == {"people": 1}
    assert api("POST", f"{address}/grant", body).data == {"people": 0}
    [member] = api("GET", "/courses/hri/members").data["members"]
    [held] = member["qualifications"]
    assert held["qualification"] == "induction"
    assert held["expires_at"] == QualificationGrant.objects.get().expires_at.strftime("%Y-%m-%dT%H:%M:%SZ")
    assert api("POST", f"{address}/revoke", {"people": None}).data == {"people": 1}
    assert not QualificationGrant.objects.exists()
    supervisor = {"people": [second_operator.username]}  # not enrolled
    assert api("POST", f"{address}/grant", supervisor).data == {"people": 1}
    assert api("POST", f"{address}/revoke", supervisor).data == {"people": 1}


@pytest.mark.parametrize(
    ("body", "status", "says"),
    [
        ({}, 400, "people"),
        ({"people": []}, 400, "people"),
        ({"people": "stranger"}, 400, "people"),
        ({"people": ["stranger"], "until": "2027-01-01"}, 400, "unknown field until"),
        ({"people": ["stranger"], "last_day": "2020-01-01"}, 400, "over"),
        ({"people": ["stranger"], "last_day": "9999-12-31"}, 400, "too far ahead"),
        ({"people": ["stranger"], "last_day": "soon"}, 400, "last_day"),
        ({"people": ["stranger", "operator"]}, 404, "operator is not in HRI"),
    ],
)
def test_a_grant_that_does_not_fit_is_named(
    hri, induction, operator, second_operator, program, body, status, says
):
    answer = program(second_operator)("POST", "/courses/hri/qualifications/induction/grant", body)
    assert answer.status_code == status, answer.data
    assert says in answer.data["detail"]
    assert not QualificationGrant.objects.exists()


def test_what_no_robot_of_the_course_demands_is_not_granted(hri, second_operator, program):
    Qualification.objects.create(name="Other", slug="other")
    api = program(second_operator)
    assert api("POST", "/courses/hri/qualifications/other/grant", {"people": None}).status_code == 404
