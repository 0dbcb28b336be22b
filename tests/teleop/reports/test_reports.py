"""Report pages: access and content."""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from django.conf import settings
from django.db import connection
from django.test import AsyncClient, Client
from django.test.utils import CaptureQueriesContext
from django.urls import reverse
from django.utils.timezone import now
from msgspec.structs import replace

from fleet.audit.models import Record
from fleet.audit.retention import take_out
from fleet.audit.services import record
from robots.access.services import role_set
from robots.registry.models import RobotRole, Role
from teleop.models import ControlSession, EndReason
from teleop.reports import own_data, robot_report, session_report
from teleop.reports.path_plot import DrivePath, plot_drives
from tests.teleop.support import store_sessions

pytestmark = pytest.mark.django_db

SAID = "Where does it hurt?"
PATH = [[0.0, 1.0, 2.0, 0.0, 0.0], [5.0, 2.0, 2.0, 0.0, 0.2], [8.0, 5.0, 2.0, 1.57, 1.0]]


@pytest.fixture
def session(robot, operator):
    """The operator had control for a minute."""
    began = now() - timedelta(minutes=1)
    return ControlSession.objects.create(
        robot=robot,
        user=operator,
        fence=1,
        started_at=began,
        ended_at=began + timedelta(minutes=1),
        end_reason=EndReason.RELEASED,
    )


@pytest.fixture
def put(session, robot, operator):
    """`put(kind, ...)` writes a record of that session."""

    def put_one(kind, **facts):
        of_session = {
            "actor": operator,
            "robot_id": robot.pk,
            "robot_name": robot.name,
            "session_id": session.pk,
        }
        return record(kind, **{**of_session, **facts})

    return put_one


@pytest.fixture
def drive(put):
    """`drive(map_to_odom=None)` records a drive of 4 m in 8 s along `PATH` with one gate intervention.

    `as_once`: in the format used until November 2026, with the figures next to the path.
    """

    def drive_once(map_to_odom=None, as_once=False):
        start = put("drive.start", private={"pose": PATH[0][1:4], "map_to_odom": map_to_odom})
        held = put(
            "gate.begin",
            of=start,
            outcome="obstacle",
            private={"words": "A wall.", "t_s": 6.0, "pose": [3.0, 2.0, 0.0]},
        )
        put("gate.end", of=held)
        figures = {"distance_m": 4.0, "duration_s": 8.0, "interventions": 1}
        where = {"path": PATH, "map_to_odom": map_to_odom}
        figures_and_path = (
            {"private": figures | where} if as_once else {"parameters": figures, "private": where}
        )
        put("drive.end", of=start, outcome="standstill", **figures_and_path)
        return start

    return drive_once


@pytest.fixture
def said(put):
    """A record of speech by the operator."""
    start = put("speech.start", text=SAID, parameters={"language": "en-GB", "topic": "/tts"})
    put("speech.end", of=start, outcome="succeeded")
    return start


# --- access ---------------------------------------------------------------------------------------

PEOPLE = {
    #       status of: session, report of the robot
    "anonymous": (401, 401),
    "stranger": (404, 404),
    "observer": (404, 403),
    "operator": (200, 403),
    "second_operator": (404, 403),
    "supervisor": (200, 200),
    "other_supervisor": (404, 404),
    "staff": (200, 200),
}


def browser_of(person, request, signed_in):
    return Client() if person == "anonymous" else signed_in(request.getfixturevalue(person))


@pytest.mark.parametrize("person", PEOPLE)
def test_each_page_is_only_for_the_people_concerned(person, request, signed_in, session, robot, said, drive):
    drive()
    client = browser_of(person, request, signed_in)
    addresses = [reverse("control-session", args=[session.pk]), reverse("robot-report", args=[robot.slug])]
    answers = [client.get(address) for address in addresses]
    assert tuple(answer.status_code for answer in answers) == PEOPLE[person]
    for answer in answers:
        if answer.status_code != 200:
            assert SAID not in answer.content.decode()


@pytest.mark.parametrize("person", [*PEOPLE])
def test_people_see_only_their_own_records(person, request, signed_in, said, session):
    answer = browser_of(person, request, signed_in).get(reverse("your-data"))
    assert answer.status_code == (401 if person == "anonymous" else 200)
    page = answer.content.decode()
    assert (SAID in page) == (person == "operator")
    assert (str(session.pk) in page) == (person == "operator")


@pytest.mark.parametrize("person", PEOPLE)
def test_robot_page_links_to_its_report_for_supervisors(person, request, signed_in, robot):
    page = browser_of(person, request, signed_in).get(reverse("control", args=[robot.slug]))
    leads = reverse("robot-report", args=[robot.slug]) in page.content.decode()
    assert leads == (PEOPLE[person][1] == 200)


def test_person_without_any_role_still_sees_own_records(operator, signed_in, session, said):
    RobotRole.objects.filter(user=operator).delete()
    page = signed_in(operator).get(reverse("control-session", args=[session.pk]))
    assert SAID in page.content.decode()


@pytest.mark.parametrize("person", ["anonymous", "operator"])
def test_privacy_page_shows_what_is_kept_for_how_long(person, request, signed_in):
    page = browser_of(person, request, signed_in).get(reverse("privacy")).content.decode()
    for days in [*settings.FLEET_AUDIT_KEEP_DAYS.values(), settings.FLEET_AUDIT_KEEP_RECORDS_DAYS]:
        assert f"{days} days" in page
    assert "each viewing of a camera" in page.lower()


def test_details_are_deleted_with_their_records_at_the_latest(client, settings):
    settings.FLEET_AUDIT_KEEP_RECORDS_DAYS = 400
    days = [kept["days"] for kept in client.get(reverse("privacy")).context["classes"]]
    assert max(days) == 400


# --- a control session ----------------------------------------------------------------------------


def test_timeline_has_each_request_with_its_outcome_in_order(put, session, drive, said):
    put("control.take")
    drive()
    entries = session_report.report_of(session).entries
    assert [entry.group for entry in entries] == ["speech", "control", "drive", "gate"]
    assert (entries[0].subject, entries[0].facts[0]) == (SAID, "succeeded")
    assert "distance 4 m" in entries[2].facts
    assert entries[0].at_s <= entries[1].at_s


def test_timeline_has_the_robots_own_events_of_that_time(put, session, robot, other_robot, supervisor):
    put("control.take")
    record("stop.press", actor=supervisor, robot_id=robot.pk, parameters={"times": 3})
    record("stop.press", actor=supervisor, robot_id=other_robot.pk)
    put("control.end", outcome="released")
    record("stop.press", actor=supervisor, robot_id=robot.pk)
    report = session_report.report_of(session)
    assert [(entry.group, entry.facts[:1]) for entry in report.entries] == [
        ("control", []),
        ("stop", ["Sue Pervisor"]),
        ("control", ["released"]),
    ]
    assert report.figures.stops == 3


def test_figures_cover_all_drives(session, drive):
    drive()
    drive()
    figures = session_report.report_of(session).figures
    assert (figures.lasted, figures.driven, figures.distance_m) == ("0:01:00", "0:00:16", 8.0)
    assert (figures.interventions, figures.stops, figures.complete) == (2, 0, True)


def test_path_is_drawn_in_colours_of_speed_with_marks(session, drive):
    drive()
    plot = session_report.report_of(session).plot
    assert [line.pace for line in plot.lines] == [1, 4]  # 0.2 m/s, then 1 m/s
    [(x, y)] = plot.marks
    [(_, x0, y0, _), (_, x1, _, _), (s2, x2, y2, degrees)] = plot.replay[0]
    assert x == pytest.approx((x1 + (x2 - x1) / 3), abs=0.2)
    assert y == y0 == y2
    assert x0 < x1 < x2
    assert s2 == pytest.approx(session_report.report_of(session).entries[0].at_s + 8.0)
    assert degrees == pytest.approx(-90, abs=0.1)
    assert not plot.on_map


def test_path_is_drawn_on_the_map_if_its_pose_is_known(session, drive):
    drive(map_to_odom=[10.0, 0.0, 1.5708])
    plot = session_report.report_of(session).plot
    assert plot.on_map
    [(_, x0, y0, degrees), _, (_, x2, y2, _)] = plot.replay[0]
    assert degrees == pytest.approx(-90, abs=0.1)  # east by odometry is north on the map
    assert x2 == pytest.approx(x0, abs=0.2)
    assert y2 < y0


def test_left_bend_by_odometry_is_a_left_bend_on_the_map():
    bend = [[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0, 1.0], [2.0, 1.0, 1.0, 1.57, 1.0]]
    plot = plot_drives([DrivePath(0.0, bend, frame=[10.0, 0.0, math.pi / 2])], [])
    [(_, x0, y0, _), (_, x1, y1, _), (_, x2, y2, _)] = plot.replay[0]
    assert (x1, y2) == pytest.approx((x0, y1))
    assert y1 < y0  # north, which is up
    assert x2 < x1  # west


def test_drive_of_a_killed_bridge_has_no_path(session, put):
    start = put("drive.start", private={"pose": [0.0, 0.0, 0.0], "map_to_odom": None})
    put("drive.end", of=start, outcome="bridge_killed")
    report = session_report.report_of(session)
    assert report.plot is None
    assert report.figures.driven == "0:00:00"
    assert report.entries[0].facts == ["bridge killed"]


def test_expired_details_are_shown_as_expired(session, drive, said, signed_in, operator):
    drive()
    list(take_out([*Record.objects.values_list("pk", flat=True)]))
    page = signed_in(operator).get(reverse("control-session", args=[session.pk])).content.decode()
    assert "The path has expired: it is kept for 365 days." in page
    assert "details expired" in page
    assert SAID not in page


def test_long_session_shows_its_newest_entries(session, put, monkeypatch):
    monkeypatch.setattr(session_report, "MOST_ENTRIES", 2)
    for _ in range(3):
        last = put("refusal", outcome="too_old")
    report = session_report.report_of(session)
    assert report.truncated
    assert [entry.number for entry in report.entries] == [last.pk - 1, last.pk]


def test_page_opens_without_any_record(session, signed_in, operator):
    page = signed_in(operator).get(reverse("control-session", args=[session.pk])).content.decode()
    assert "No records." in page


# --- a robot --------------------------------------------------------------------------------------

TUESDAY = datetime(2026, 11, 17, 14, 30, tzinfo=UTC)


@pytest.fixture
def at(monkeypatch):
    """`at(moment)` sets the clock of the next records."""

    def move(moment):
        monkeypatch.setattr("django.utils.timezone.now", lambda: moment)

    return move


def test_robot_report_has_hours_distance_and_interventions(robot, drive, at):
    at(TUESDAY)
    drive()
    at(TUESDAY + timedelta(days=3))
    drive()
    report = robot_report.report_of(robot, 7, TUESDAY + timedelta(days=4))
    assert (report.drives, report.distance_m, report.interventions) == (2, 8.0, 2)
    assert report.driven == "0:00:16"
    assert report.interventions_per_hour is None  # a rate of a quarter of a minute says nothing
    assert replace(report, driven_h=1.5, interventions=36).interventions_per_hour == 24.0
    assert [day.metres for day in report.use.days] == [0, 0, 4, 0, 0, 4, 0]
    assert [bool(hours) for hours in report.use.hours] == [hour == 14 for hour in range(24)]
    assert [bool(hours) for hours in report.use.weekdays] == [day in (1, 4) for day in range(7)]
    assert [(reason.code, reason.times, reason.words) for reason in report.reasons] == [
        ("obstacle", 2, "A wall.")
    ]


def test_figures_of_drives_remain_after_their_paths_expired(robot, session, drive, at):
    at(TUESDAY)
    drive()
    list(take_out([*Record.objects.values_list("pk", flat=True)]))
    report = robot_report.report_of(robot, 7, TUESDAY)
    assert (report.driven, report.distance_m, report.drives) == ("0:00:08", 4.0, 1)
    figures = session_report.report_of(session).figures
    assert (figures.driven, figures.distance_m, figures.complete) == ("0:00:08", 4.0, True)


def test_drives_of_older_versions_count_until_they_expire(robot, session, drive, at):
    at(TUESDAY)
    drive()
    drive(as_once=True)
    report = robot_report.report_of(robot, 7, TUESDAY)
    assert (report.driven, report.distance_m, report.drives) == ("0:00:16", 8.0, 2)
    figures = session_report.report_of(session).figures
    assert (figures.driven, figures.distance_m, figures.complete) == ("0:00:16", 8.0, True)
    list(take_out([*Record.objects.values_list("pk", flat=True)]))
    assert robot_report.report_of(robot, 7, TUESDAY).distance_m == 4.0
    assert not session_report.report_of(session).figures.complete


def test_older_records_and_other_robots_do_not_count(robot, other_robot, drive, put, at):
    at(TUESDAY - timedelta(days=7))
    drive()
    at(TUESDAY)
    start = put("drive.start", robot_id=other_robot.pk)
    figures = {"distance_m": 1.0, "duration_s": 1.0}
    put("drive.end", of=start, robot_id=other_robot.pk, parameters=figures)
    record("fault", robot_id=other_robot.pk, outcome="bridge_lost")
    report = robot_report.report_of(robot, 7, TUESDAY)
    assert (report.drives, report.driven_h, report.interventions, report.faults) == (0, 0.0, 0, [])
    assert robot_report.report_of(robot, 30, TUESDAY).drives == 1


def test_every_stop_press_counts_even_in_shared_records(robot, put, at):
    at(TUESDAY)
    put("stop.press", parameters={"through": "page"})
    pressed = put("stop.press", parameters={"through": "page", "times": 4})
    record("stop.press", of=pressed, outcome="stopped")
    assert robot_report.report_of(robot, 7, TUESDAY).stops == 5


def test_records_of_a_clock_that_was_ahead_do_not_count(robot, drive, put, at):
    at(TUESDAY + timedelta(days=1000))
    drive()
    put("stop.press")
    record("fault", robot_id=robot.pk, outcome="bridge_lost")
    report = robot_report.report_of(robot, 7, TUESDAY)
    assert (report.drives, report.interventions, report.stops, report.faults) == (0, 0, 0, [])


def test_newest_faults_are_listed(robot, at):
    at(TUESDAY)
    record("fault", robot_id=robot.pk, outcome="bridge_lost", private={"words": "The link broke."})
    [fault] = robot_report.report_of(robot, 7, TUESDAY).faults
    assert fault.what == "The link broke."


def test_expired_fault_is_named_by_its_outcome(robot, at):
    at(TUESDAY)
    begun = record("fault", robot_id=robot.pk, outcome="bridge_lost")
    record("fault", of=begun, outcome="over")
    [fault] = robot_report.report_of(robot, 7, TUESDAY).faults
    assert fault.what == "bridge lost"


def test_a_part_that_got_worse_is_listed_also_after_its_words_expired(robot, at):
    at(TUESDAY)
    for part, text in (("Speakers", "Speakers: Amplifier does not answer"), ("Motor", "")):
        change = {"part": part, "from": "ok", "to": "error"}
        record("health.worse", robot_id=robot.pk, parameters=change, text=text)
    record("health.better", robot_id=robot.pk, parameters=change, text="Motor: OK")
    assert [fault.what for fault in robot_report.report_of(robot, 7, TUESDAY).faults] == [
        "Motor: error",
        "Speakers: Amplifier does not answer",
    ]


def test_a_part_that_flaps_hides_no_fault_and_no_other_part(robot, at):
    at(TUESDAY)
    record("fault", robot_id=robot.pk, outcome="bridge_lost")
    for part in ("Motor", *["Speakers"] * (robot_report.FAULTS + 1)):
        change = {"part": part, "from": "ok", "to": "error"}
        record("health.worse", robot_id=robot.pk, parameters=change, text=part)
    found = [fault.what for fault in robot_report.report_of(robot, 7, TUESDAY).faults]
    assert found == ["Speakers", "Motor", "bridge lost"]


def test_report_needs_no_more_queries_for_a_long_log(robot, drive, django_assert_max_num_queries):
    for _ in range(3):
        drive()
    with django_assert_max_num_queries(8):
        robot_report.report_of(robot, 365, now())


@pytest.mark.parametrize("days", ["", "0", "31", "all"])
def test_unknown_period_is_refused(days, robot, supervisor, signed_in):
    address = reverse("robot-report", args=[robot.slug])
    assert signed_in(supervisor).get(address, {"days": days}).status_code == 400


# --- own data -------------------------------------------------------------------------------------


def test_own_records_come_page_by_page(operator, signed_in, put):
    for number in range(70):
        put("refusal", private={"words": f"number {number}."})
    client, found, query = signed_in(operator), [], ""
    while query is not None:
        context = client.get(reverse("your-data") + query).context
        found += [line.subject for line in context["lines"]]
        query = f"?before={context['oldest_number']}" if context["page"].older else None
    sign_in, *refusals = found
    assert sign_in == ""
    assert refusals == [f"number {number}." for number in reversed(range(70))]


def test_own_viewings_of_cameras_are_shown_on_demand(operator, signed_in, put):
    put("camera.start")
    client, page = signed_in(operator), reverse("your-data")
    assert "began to watch" not in client.get(page).text
    assert "began to watch" in client.get(f"{page}?viewings=1").text


def test_own_sessions_come_page_by_page(operator, robot, signed_in):
    began = now()
    store_sessions(robot, operator, (began - timedelta(hours=number) for number in range(25)), began)
    client = signed_in(operator)
    first = client.get(reverse("your-data")).context
    second = client.get(reverse("your-data"), {"began_before": first["oldest_session"]}).context
    fences = [session.fence for context in (first, second) for session in context["sessions"].shown]
    assert fences == list(range(25))
    assert (first["sessions"].older, second["sessions"].older) == (True, False)


@pytest.mark.parametrize(
    "query",
    [
        "before=x",
        "began_before=x",
        "began_before=2026-01-01T00:00:00",
        "began_before=0001-01-01T00:00:00%2B23:59",
        "began_before=9999-12-31T23:59:59-23:59",
    ],
)
def test_invalid_address_is_refused(query, operator, signed_in):
    assert signed_in(operator).get(f"{reverse('your-data')}?{query}").status_code == 400


def test_export_needs_a_post(operator, signed_in):
    assert signed_in(operator).get(reverse("your-data-export")).status_code == 405


@pytest.fixture
def meddled(session, robot, other_robot, operator, staff, supervisor, second_operator, put):
    """Records by others about the operator and about other people, all with names or typed words in them."""
    secret = "Sam Staff's own words, sam@lab.example"
    mine, theirs = str(operator.pk), str(second_operator.pk)
    author = {"actor": staff, "text": secret, "private": {"words": secret, "holder_name": "Sue Pervisor"}}
    for user, name in ((mine, "Olga Operator"), (theirs, "Sue Pervisor")):
        changes = [{"field": "email", "from": "", "to": f"{name}@lab.example"}]
        record(
            "account.change",
            actor=staff,
            parameters={"user": user, "changes": [{"field": "email"}]},
            private={"name": name, "changes": changes},
        )
        record("control.take_over", **author, session_id=other_robot.pk, parameters={"holder": user})
        record("audit.export", **author, parameters={"list": f"speech of {name}", "person": user})
    put("stop.press", **author, parameters={"through": "page"})
    put("control.end", **author, outcome="taken_over", parameters={"holder": mine, "to": theirs})
    put("control.end", actor=None, outcome="term", parameters={"holder": mine})
    return "Sam", "sam@", "Sue", theirs, str(staff.pk)


def test_own_data_has_records_by_others_without_their_names(meddled, operator, signed_in):
    page = signed_in(operator).get(reverse("your-data"))
    assert [(line.what, line.by) for line in page.context["about"]][:6] == [
        ("control ended", "by the console itself"),
        ("control ended", "by another person"),
        ("stop pressed", "by another person"),
        ("log exported", "by another person"),
        ("control taken over", "by another person"),
        ("account changed", "by another person"),
    ]
    words = page.content.decode()
    assert "Olga Operator@lab.example" in words
    assert not [word for word in meddled if word in words]


def test_records_by_others_have_their_outcome(session, operator, staff, signed_in, put):
    pressed = put("stop.press", actor=staff, parameters={"through": "page"})
    record("stop.press", of=pressed, outcome="latched", parameters={"confirmed": True})
    line, *_ = signed_in(operator).get(reverse("your-data")).context["about"]
    assert (line.outcome, line.subject) == ("latched", "through page · confirmed yes")


def test_own_data_has_failed_sign_ins_without_their_origin(operator, client, signed_in):
    client.post(reverse("sign-in"), {"username": operator.username, "password": "guessed"})
    page = signed_in(operator).get(reverse("your-data"))
    line, *_ = page.context["about"]
    assert (line.what, line.by, line.subject, line.outcome) == (
        "sign-in failed",
        "by a person who failed to sign in",
        "",
        "refused",
    )


def test_page_has_recent_failed_sign_ins_the_export_all(operator, second_operator, signed_in, monkeypatch):
    monkeypatch.setattr(own_data, "TRIES", 4)
    people = [operator] * 2 + [second_operator] * 3 + [operator]
    tries = [
        record("account.sign_in_failed", outcome="refused", parameters={"user": str(person.pk)}).pk
        for person in people
    ]
    page = signed_in(operator).get(reverse("your-data"))
    assert [line.what for line in page.context["about"]].count("sign-in failed") == 1
    exported = [
        json.loads(line)
        for text, _ in own_data._lines_about(operator, ZoneInfo("UTC"))
        for line in text.splitlines()
    ]
    found = [entry["number"] for entry in exported if entry["kind"] == "account.sign_in_failed"]
    assert found == [tries[5], tries[1], tries[0]]


@pytest.mark.skipif(connection.vendor != "sqlite", reason="what PostgreSQL does depends on its statistics")
def test_recent_failed_sign_ins_are_found_by_the_index(operator):
    with CaptureQueriesContext(connection) as asked:
        own_data.recorded_by_others(operator, None)
    with connection.cursor() as cursor:
        cursor.execute(f"EXPLAIN QUERY PLAN {asked[0]['sql']}")
        assert "COVERING INDEX audit_kind" in str(cursor.fetchall())


def test_own_data_shows_changes_of_role_and_account(operator, robot, staff, signed_in):
    role_set(robot=robot, user=operator, role=Role.SUPERVISOR, actor=staff)
    operator.changed_by, operator.full_name, operator.is_staff = staff, "Olga O.", True
    operator.save()
    changed, given, *_ = signed_in(operator).get(reverse("your-data")).context["about"]
    assert (given.what, given.subject) == ("role changed", "from operator · to supervisor")
    assert (changed.what, changed.subject) == (
        "account changed",
        "full name Olga Operator → Olga O. · is staff no → yes",
    )


def test_records_by_others_come_page_by_page(operator, staff, signed_in, put):
    for number in range(70):
        put("stop.press", actor=staff, parameters={"through": f"number {number}."})
    client, found, query = signed_in(operator), [], ""
    while query is not None:
        context = client.get(reverse("your-data") + query).context
        found += [line.subject for line in context["about"]]
        query = f"?about_before={context['oldest_about']}" if context["oldest_about"] else None
    assert found[:70] == [f"through number {number}." for number in reversed(range(70))]
    assert (
        len(found)
        == len(Record.objects.filter(kind="account.create", parameters__user=str(operator.pk))) + 70
    )


@pytest.mark.skipif(connection.vendor != "sqlite", reason="what PostgreSQL does depends on its statistics")
def test_records_by_others_are_found_by_the_index(operator, put):
    put("stop.press")
    with CaptureQueriesContext(connection) as asked:
        own_data.recorded_by_others(operator, None)
    [of_sessions] = [query["sql"] for query in asked if "controlsession" in query["sql"]]
    with connection.cursor() as cursor:
        cursor.execute(f"EXPLAIN QUERY PLAN {of_sessions}")
        assert "COVERING INDEX audit_session" in str(cursor.fetchall())


@pytest.mark.django_db(transaction=True)
async def test_export_has_records_by_others_without_names(meddled, operator, session):
    client = AsyncClient()
    await client.aforce_login(operator)
    answer = await client.post(reverse("your-data-export"))
    text = b"".join([piece async for piece in answer.streaming_content]).decode()
    entries = [json.loads(line) for line in text.splitlines()]
    kinds = [entry["kind"] for entry in entries if "by" in entry]
    assert kinds[:3] == ["control.end", "control.end", "stop.press"]
    sessions = {entry["kind"]: entry["control_session"] for entry in entries}
    assert (sessions["stop.press"], sessions["control.take_over"]) == (str(session.pk), None)
    assert not [word for word in meddled if word in text]
    ended = await Record.objects.aget(kind="audit.export", outcome="done")
    assert ended.parameters["rows"] == len(entries)


@pytest.mark.django_db(transaction=True)
async def test_export_has_own_records_only_and_is_recorded(operator, supervisor, said):
    client = AsyncClient()
    await client.aforce_login(operator)
    answer = await client.post(reverse("your-data-export"))
    lines = b"".join([piece async for piece in answer.streaming_content]).decode().splitlines()
    entries = [json.loads(line) for line in lines]
    assert SAID in [entry["details"].get("text") for entry in entries]
    assert {entry["person"]["id"] for entry in entries if "by" not in entry} == {str(operator.pk)}
    assert {entry["by"] for entry in entries if "by" in entry} == {"somebody else"}  # who made the account
    begun = await Record.objects.aget(kind="audit.export", of=None)
    assert (begun.actor_id, begun.parameters["list"]) == (str(operator.pk), "your-data")
