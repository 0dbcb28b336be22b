"""The lists of the audit log: content, access rights, paging."""

import datetime
import re
import uuid

import pytest
from django.db import connection
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from fleet.audit.integrity.canonical import NO_ROBOT
from fleet.audit.kinds import KINDS, Listing, kinds_listed
from fleet.audit.models import Chain, Record
from fleet.audit.reading.listing import CONSOLE, COUNTED, Selection, Wanted, outcomes_of
from fleet.audit.services import record

pytestmark = pytest.mark.django_db

LISTS = ["audit_speechrecord", "audit_motionrecord", "audit_refusalrecord", "audit_record"]
ROBOT = uuid.uuid4()
SPEECH, MOTION, REFUSALS = (
    kinds_listed(listing) for listing in (Listing.SPEECH, Listing.MOTION, Listing.REFUSALS)
)


@pytest.fixture
def admin(staff, signed_in):
    return signed_in(staff)


@pytest.fixture
def on_day(monkeypatch):
    """`on_day("2026-11-03")`: date the next records to that day."""

    def at(day, hour=12):
        moment = datetime.datetime.fromisoformat(f"{day}T{hour:02}:00:00+00:00")
        monkeypatch.setattr(timezone, "now", lambda: moment)

    return at


def say(text, *, actor=None, robot_id=ROBOT, robot_name="TIAGo 1", outcome="succeeded", **more):
    start = record("speech.start", actor=actor, robot_id=robot_id, robot_name=robot_name, text=text, **more)
    if outcome:
        record("speech.end", actor=actor, of=start, outcome=outcome)
    return start


def shown(kinds=None, **wanted):
    """Return the requests that a list shows, newest first."""
    return [row.record for row in Selection(Wanted(**wanted), kinds).page().rows]


def test_viewings_of_cameras_are_shown_on_demand(admin, operator):
    session = uuid.uuid4()
    record("camera.start", actor=operator, session_id=session)
    say("hello", actor=operator)

    def kinds(query):
        page = admin.get(f"{reverse('admin:audit_record_changelist')}?{query}&person=Olga")
        return [line.what for _day, _url, lines in page.context["days"] for line in lines]

    viewing = "began to watch a camera"
    assert len(kinds("")) == 1
    assert kinds("viewings=on").count(viewing) == 1
    assert kinds("kind=camera.start") == kinds(f"session={session}") == [viewing]


# --- access -------------------------------------------------------------------------------------


def addresses():
    entry = say("hello")
    for name in LISTS:
        yield "get", reverse(f"admin:{name}_changelist")
        yield "post", reverse(f"admin:{name}_export")
    yield "get", reverse("admin:audit_record_change", args=[entry.pk])


@pytest.mark.parametrize("person", ["anonymous", "stranger", "observer", "operator", "supervisor"])
def test_only_staff_see_a_list_a_record_or_an_export(person, request, signed_in):
    client = Client() if person == "anonymous" else signed_in(request.getfixturevalue(person))
    for method, address in addresses():
        response = getattr(client, method)(address, {"format": "csv"})
        assert response.status_code in (302, 401, 403), address
        assert not response.streaming, address
        assert "hello" not in response.content.decode(), address
    assert not Record.objects.filter(kind="audit.export").exists()


def test_staff_see_each_list_and_each_record(admin):
    for method, address in addresses():
        if method == "get":
            assert admin.get(address).status_code == 200, address


def test_former_staff_see_nothing(staff, admin):
    staff.is_staff = False
    staff.save()
    assert admin.get(reverse("admin:audit_record_changelist")).status_code == 302


def test_a_list_only_reads(admin):
    for name in LISTS:
        assert admin.post(reverse(f"admin:{name}_changelist"), {"kind": "x"}).status_code == 405


# --- content ------------------------------------------------------------------------------------


def test_a_request_and_its_outcome_are_one_row(operator):
    start = say("hello", actor=operator, outcome="cancelled")
    [row] = Selection(Wanted(), SPEECH).page().rows
    assert (row.record, row.end.of, row.outcome) == (start, start, "cancelled")


def test_without_an_outcome_there_is_none_yet():
    say("hello", outcome="")
    [row] = Selection(Wanted(), SPEECH).page().rows
    assert (row.end, row.outcome) == (None, "")


def test_an_outcome_of_its_requests_kind_has_no_own_row():
    pressed = record("stop.press", robot_id=ROBOT)
    record("stop.press", of=pressed, outcome="stopped")
    [row] = Selection(Wanted(), None).page().rows[:1]
    assert (row.record, row.outcome) == (pressed, "stopped")


def test_gate_interventions_have_rows_next_to_their_drive():
    drive = record("drive.start", robot_id=ROBOT)
    held = record("gate.begin", of=drive, outcome="obstacle")
    record("gate.end", of=held)
    record("drive.end", of=drive, outcome="standstill")
    [row] = Selection(Wanted(), MOTION).page().rows
    assert (row.record, row.outcome) == (drive, "standstill")
    [row] = Selection(Wanted(), REFUSALS).page().rows
    assert (row.record, row.outcome, row.end.kind) == (held, "obstacle", "gate.end")


def test_each_list_shows_its_kinds_and_everything_shows_all():
    entries = {kind: record(kind) for kind in ("speech.start", "motion.start", "refusal", "robot.change")}
    assert shown(SPEECH) == [entries["speech.start"]]
    assert shown(MOTION) == [entries["motion.start"]]
    assert shown(REFUSALS) == [entries["refusal"]]
    assert set(entries.values()) <= set(shown())


def test_filters_are_robot_person_outcome_kind_and_session(operator, supervisor):
    session = uuid.uuid4()
    mine = say("mine", actor=operator, session_id=session)
    other = say("other", actor=supervisor, robot_id=uuid.uuid4(), robot_name="TIAGo 2", outcome="failed")
    alone = record("motion.start", robot_id=ROBOT, actor=operator)
    assert shown(robot=ROBOT) == [alone, mine]
    assert shown(person=str(operator.pk)) == [alone, mine]
    assert shown(robot=other.robot_id, person=str(operator.pk)) == []
    assert shown(outcome="failed") == [other]
    assert shown(outcome="failed", robot=ROBOT) == []
    assert shown(SPEECH, outcome="failed", person=str(supervisor.pk)) == [other]
    assert shown(MOTION, outcome="failed") == []
    assert shown(kind="motion.start") == [alone]
    assert shown(SPEECH, kind="motion.start") == []
    assert shown(session=session) == [mine]


def test_console_and_robotless_records_can_be_filtered(operator):
    nobody = record("control.expire", robot_id=ROBOT)
    signed_in = record("account.sign_in", actor=operator)
    assert nobody in shown(person=CONSOLE)
    assert signed_in not in shown(person=CONSOLE)
    assert signed_in in shown(robot=NO_ROBOT)
    assert nobody not in shown(robot=NO_ROBOT)


def test_a_person_is_found_as_actor_and_as_real_actor(operator, supervisor):
    entry = record("stop.press", actor=operator, real_actor=supervisor, robot_id=ROBOT)
    assert shown(person=str(operator.pk)) == [entry]
    assert shown(person=str(supervisor.pk)) == [entry]


def test_a_person_who_is_also_the_real_actor_is_found_once(operator):
    entry = record("stop.press", actor=operator, real_actor=operator, robot_id=ROBOT)
    assert shown(person=str(operator.pk)) == [entry]


def test_outcomes_to_choose_from_are_those_of_the_list():
    say("hello", outcome="cancelled")
    record("refusal", outcome="not_holder")
    assert outcomes_of(["speech.start", "speech.end"]) == [("speech.end", "cancelled")]
    assert ("refusal", "not_holder") in outcomes_of(KINDS)
    assert outcomes_of([]) == []


# --- days ---------------------------------------------------------------------------------------


def test_days_are_included_from_the_first_to_the_last(on_day):
    entries = []
    for day in ("2026-11-02", "2026-11-03", "2026-11-05"):
        on_day(day)
        entries.append(say(day))
    first, second, last = entries
    date = datetime.date.fromisoformat
    assert shown(SPEECH, since=date("2026-11-03"), until=date("2026-11-03")) == [second]
    assert shown(SPEECH, since=date("2026-11-03")) == [last, second]
    assert shown(SPEECH, until=date("2026-11-04")) == [second, first]
    assert shown(SPEECH, since=date("2026-11-04"), until=date("2026-11-04")) == []


def test_a_clock_that_was_set_wrong_hides_no_record_of_a_day(on_day):
    on_day("2030-01-01")
    wrong = say("from the future")
    on_day("2026-11-03")
    right = say("today")
    assert shown(SPEECH, since=datetime.date(2026, 11, 1)) == [right, wrong]
    assert shown(SPEECH, since=datetime.date(2027, 1, 1)) == [wrong]
    assert shown(SPEECH, until=datetime.date(2027, 1, 1)) == [right]


def test_days_before_and_after_have_rows_of_the_filter(on_day, operator):
    for day in ("2026-11-02", "2026-11-04", "2026-11-09"):
        on_day(day)
        say(day, actor=operator)
    on_day("2026-11-05")
    record("robot.change")
    day = datetime.date(2026, 11, 4)
    selection = Selection(Wanted(since=day, until=day, person=str(operator.pk)), SPEECH)
    assert selection.day_beside(later=True) == datetime.date(2026, 11, 9)
    assert selection.day_beside(later=False) == datetime.date(2026, 11, 2)
    assert Selection(Wanted(), SPEECH).day_beside(later=True) is None


def test_the_neighbouring_day_is_found_at_any_distance(on_day):
    for day in ("2020-01-01", "2026-11-04", "2031-05-05"):
        on_day(day)
        say(day)
    day = datetime.date(2026, 11, 4)
    selection = Selection(Wanted(since=day, until=day), SPEECH)
    assert selection.day_beside(later=True) == datetime.date(2031, 5, 5)
    assert selection.day_beside(later=False) == datetime.date(2020, 1, 1)


@pytest.mark.parametrize(("word", "far"), [("old", True), ("ol", False)])
def test_short_words_are_searched_in_a_near_day_only(on_day, word, far):
    for day in ("2020-01-01", "2026-11-04", "2026-11-24"):
        on_day(day)
        say("older")
    day = datetime.date(2026, 11, 4)
    selection = Selection(Wanted(since=day, until=day, words=(word,)), SPEECH)
    assert selection.day_beside(later=True) == datetime.date(2026, 11, 24)
    assert selection.day_beside(later=False) == (datetime.date(2020, 1, 1) if far else None)


@pytest.mark.parametrize("day", [datetime.date.min, datetime.date.max])
def test_the_ends_of_the_calendar_are_days_like_others(day, admin):
    say("hello")
    query = f"since={day.isoformat()}&until={day.isoformat()}"
    for name in [*LISTS, "teleop_controlsession"]:
        assert admin.get(f"{reverse(f'admin:{name}_changelist')}?{query}").status_code == 200


# --- pages --------------------------------------------------------------------------------------


def pages_downwards(selection, size, meanwhile=lambda: None):
    page = selection.page(size=size)
    while True:
        yield page
        if not page.older:
            return
        meanwhile()
        page = selection.page(size=size, before=page.rows[-1].number)


@pytest.mark.parametrize(
    "wanted", [{}, {"robot": ROBOT}, {"outcome": "succeeded"}, {"words": ("text",)}, {"person": CONSOLE}]
)
def test_pages_have_every_row_once_also_while_records_are_added(wanted):
    expected = [say(f"text {number}") for number in range(7)][::-1]
    selection = Selection(Wanted(**wanted), SPEECH)
    pages = list(pages_downwards(selection, 2, meanwhile=lambda: say("text that is newer")))
    assert [row.record for page in pages for row in page.rows] == expected
    assert [page.count for page in pages] == [7, None, None, None]


def test_pages_upwards_meet_those_downwards():
    expected = [say(f"text {number}") for number in range(7)][::-1]
    selection = Selection(Wanted(), SPEECH)
    last = list(pages_downwards(selection, 2))[-1]
    found = [row.record for row in last.rows]
    page = last
    while page.newer:
        page = selection.page(size=2, after=page.rows[0].number)
        found = [row.record for row in page.rows] + found
    assert found == expected
    assert last.newer
    assert page.older


def test_rows_of_several_kinds_are_in_the_order_of_their_numbers():
    entries = [record(kind, robot_id=ROBOT) for kind in ("drive.start", "motion.start") * 3]
    assert shown(MOTION) == entries[::-1]


def test_more_than_a_thousand_are_not_counted(monkeypatch, admin):
    monkeypatch.setattr("fleet.audit.reading.listing.COUNTED", 5)
    monkeypatch.setattr("fleet.audit.admin.COUNTED", 5)
    for _ in range(7):
        say("hello")
    assert Selection(Wanted(), SPEECH).page().count == 6
    page = admin.get(reverse("admin:audit_speechrecord_changelist")).content.decode()
    assert "more than 5 found" in page
    assert COUNTED == 1000


def test_a_page_costs_as_many_queries_for_fifty_rows_as_for_one(admin, django_assert_max_num_queries):
    for number in range(60):
        say(f"text {number}")
    with django_assert_max_num_queries(20):
        assert admin.get(reverse("admin:audit_speechrecord_changelist")).status_code == 200


@pytest.mark.parametrize("wanted", ["robot", "person", "outcome", "robot and person"])
def test_filters_are_looked_up_in_indexes_alone(wanted, operator):
    conditions = {
        "robot": {"robot": ROBOT},
        "person": {"person": str(operator.pk)},
        "outcome": {"outcome": "succeeded"},
        "robot and person": {"robot": ROBOT, "person": str(operator.pk)},
    }[wanted]
    if connection.vendor != "sqlite":
        pytest.skip("what PostgreSQL does depends on its statistics")
    say("hello", actor=operator)
    for kinds in (None, SPEECH):
        for stream in Selection(Wanted(**conditions), kinds)._streams():
            plan = stream.order_by("-pk").values_list("pk")[:10].explain()
            assert "COVERING INDEX" in plan or "audit_real_actor" in plan, plan
            assert "TEMP B-TREE" not in plan


def test_staff_read_above_each_list_that_the_clock_is_doubted(admin):
    address = reverse("admin:audit_speechrecord_changelist")
    record("audit.clock", outcome="doubted")
    assert "confirm_clock" in admin.get(address).content.decode()
    record("audit.clock", outcome="confirmed")
    assert "confirm_clock" not in admin.get(address).content.decode()


# --- browsing -------------------------------------------------------------------------------------


def test_a_list_shows_person_action_and_outcome(admin, operator):
    say("Guten Morgen", actor=operator, outcome="failed")
    page = admin.get(reverse("admin:audit_speechrecord_changelist")).content.decode()
    for words in ("Guten Morgen", "Olga Operator", "TIAGo 1", "failed"):
        assert words in page


def test_the_address_keeps_filters_and_older_rows(admin, operator):
    for number in range(60):
        say(f"text {number}", actor=operator)
    address = f"{reverse('admin:audit_speechrecord_changelist')}?person={operator.pk}&q=text"
    first = admin.get(address)
    [older] = re.findall(r'href="(\?[^"]*before=\d+)"', first.content.decode())
    second = admin.get(reverse("admin:audit_speechrecord_changelist") + older.replace("&amp;", "&"))
    assert f"person={operator.pk}" in older
    assert "q=text" in older
    assert "text 59" in first.content.decode()
    assert "text 9" in second.content.decode()
    assert "text 59" not in second.content.decode()


@pytest.mark.parametrize(
    "query",
    ["since=yesterday", "robot=nobody", "since=2026-11-03&until=2026-11-02", "session=x", "person=nobody"],
)
def test_a_filter_that_is_not_valid_is_said_and_nothing_is_shown(query, admin):
    say("hello")
    response = admin.get(f"{reverse('admin:audit_record_changelist')}?{query}")
    assert response.status_code == 200
    assert "hello" not in response.content.decode()
    assert "errorlist" in response.content.decode()


@pytest.mark.parametrize(
    "query", ["before=x", "after=-1", "before=1e5", f"before={'9' * 40}", "before=%D9%A3"]
)
def test_a_page_that_is_not_a_number_is_refused(query, admin):
    assert admin.get(f"{reverse('admin:audit_record_changelist')}?{query}").status_code == 400


def test_spoken_texts_are_shown_as_text_not_as_markup(admin):
    start = say("<script>alert(1)</script>")
    for address in (
        reverse("admin:audit_speechrecord_changelist"),
        reverse("admin:audit_record_change", args=[start.pk]),
    ):
        assert "<script>alert" not in admin.get(address).content.decode()


def test_a_record_links_its_request_and_its_outcome(admin):
    start = say("hello")
    end = Record.objects.get(of=start)
    assert reverse("admin:audit_record_change", args=[end.pk]) in page_of(admin, start)
    assert reverse("admin:audit_record_change", args=[start.pk]) in page_of(admin, end)


def test_a_record_links_its_control_session(admin):
    start = say("hello", session_id=uuid.uuid4(), fence=7)
    page = page_of(admin, start)
    assert f"session={start.session_id}" in page
    assert "fence 7" in page


def test_a_record_shows_all_its_details_and_its_digest(admin, operator):
    entry = record(
        "robot.change",
        actor=operator,
        parameters={"speed_mps": 0.4},
        private={"changes": [{"field": "enabled", "from": True, "to": False}]},
    )
    page = page_of(admin, entry)
    for words in ("0.4 m/s", "changes 1 · field", "enabled", entry.digest, str(operator.pk)):
        assert words in page


def test_details_that_have_expired_are_said_to_have(admin):
    start = say("hello", outcome="")
    start.content_kept.delete()
    assert "expired or were erased" in page_of(admin, Record.objects.get(pk=start.pk))
    assert "details expired" in admin.get(reverse("admin:audit_speechrecord_changelist")).content.decode()


def test_a_missing_record_has_no_page(admin):
    assert admin.get(reverse("admin:audit_record_change", args=[10**9])).status_code == 404


def test_outcome_pages_are_cut_by_outcome_numbers():
    start = say("hello")
    end = Record.objects.get(of=start)
    rows = Selection(Wanted(outcome="succeeded"), SPEECH).page().rows
    assert [row.record for row in rows] == [start]
    assert Selection(Wanted(outcome="succeeded"), SPEECH).numbers(5) == [end.pk]


def test_robots_are_offered_under_their_present_names(admin):
    say("hello", robot_name="TIAGo 1")
    say("hello", robot_name="Renamed")
    assert Chain.objects.get(pk=ROBOT).name == "Renamed"
    assert (
        f'<option value="{ROBOT}">Renamed</option>'
        in admin.get(reverse("admin:audit_record_changelist")).content.decode()
    )


def page_of(admin, entry):
    return admin.get(reverse("admin:audit_record_change", args=[entry.pk])).content.decode()
