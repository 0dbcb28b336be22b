"""Nobody can fill the tables: what one person may leave in them is bounded, and said in words."""

from datetime import timedelta

import pytest
from django.db import transaction
from django.test import Client
from django.utils import timezone as clock

from fleet.accounts import services as accounts
from fleet.accounts.models import SignIn, User
from fleet.audit import rates
from fleet.audit.errors import TooManyChanges
from fleet.audit.kinds import KINDS
from fleet.audit.models import Record
from fleet.audit.services import record
from fleet.bookings import services
from fleet.bookings.models import Booking, State
from fleet.bookings.services import CANCELLED_KEPT, remove_old_cancelled
from robots.access.enrolment import enrol_list
from robots.access.models import Course
from robots.access.people_lists.reading import read_people
from robots.access.selectors import lab_date
from teleop.api.v1.framework import idempotency
from teleop.models import KeyedRequest
from tests.conftest import PASSWORD
from tests.teleop.api.test_bookings import wish

pytestmark = pytest.mark.django_db


@pytest.fixture
def most(monkeypatch):
    """A person may make six changes an hour."""
    monkeypatch.setattr(rates, "MOST", ((timedelta(hours=1), "hour", 6), (rates.DAY, "day", 100)))
    return 6


def test_booking_and_cancelling_ends_at_the_rate(most, robot, operator, second_operator, staff, program):
    api = program(operator)  # the token is the first change
    codes = []
    for _ in range(10):
        made = api("POST", "/bookings", wish(robot))
        codes.append(made.data.get("code"))
        if made.status_code == 201:
            cancelled = api("DELETE", f"/bookings/{made.data['id']}", If_Match='"1"')
            assert cancelled.status_code < 300
    assert codes == [None] * (most - 1) + ["too_many_changes"] * (11 - most)
    assert (made.status_code, made.data["figures"]["most"], made.data["figures"]["per"]) == (
        429,
        most,
        "hour",
    )
    assert 0 < int(made["Retry-After"]) <= 3600
    assert "400" not in made.data["text"] and f"{most} changes within one hour" in made.data["text"]
    assert Booking.objects.count() == most - 1
    keyed = api("POST", "/bookings", wish(robot), Idempotency_Key="a")
    assert (keyed.status_code, KeyedRequest.objects.count()) == (429, 0)
    for other in (second_operator, staff):
        assert program(other)("POST", "/bookings", wish(robot, 3 if other is staff else 1)).status_code == 201


def test_signing_in_and_out_ends_at_its_own_rate(monkeypatch, operator, second_operator):
    monkeypatch.setattr(rates, "MOST_SIGN_INS", ((timedelta(hours=1), "hour", 2),))

    def signs_in(person):
        browser = Client()
        return browser.post("/accounts/sign-in/", {"username": person.username, "password": PASSWORD})

    answers = [signs_in(operator) for _ in range(4)]
    assert [answer.status_code for answer in answers] == [302, 302, 429, 429]
    assert "signed in 2 times within one hour" in answers[-1].content.decode()
    assert SignIn.objects.filter(user=operator).count() == 2
    assert signs_in(second_operator).status_code == 302


# Kinds of records without a number of their own, and what bounds them.
BOUNDED_OTHERWISE = {
    "one outcome for each request": (
        "speech.end",
        "motion.end",
        "go.end",
        "limb.end",
        "publish.end",
        "drive.end",
    ),
    "giving back: as many as were taken": (
        "booking.cancel",
        "booking.wait_end",
        "booking.restore",
        "entry.restore",
        "booking.hand_end",
        "booking.feed_end",
        "course.unenrol",
        "course.uninvite",
        "qualification.revoke",
        "token.end",
        "place.delete",
        "layout.delete",
        "control.end",
        "recording.delete",
        "recording.end",
        "recording.let_go",
        "recording.unshare",
        "account.sign_out",
        "policy.remove",
        "push.remove",
        "robot.back_in_service",
        "camera.end",
        "turn.go_on",
        "turn.leave",
        "turn.skip",
    ),
    "their own rates": (
        "account.sign_in",
        "account.sign_in_failed",
        "refusal",
        "stop.press",
        "camera.start",
    ),
    "the console itself, or the robot": (
        "control.offer",
        "recording.expire",
        "booking.no_show",
        "turn.miss",
        "turn.wait",
        "booking.offer",
        "booking.offer_over",
        "fault",
        "alert.begin",
        "alert.still",
        "alert.over",
        "backup.make",
        "backup.check",
        "backup.restore",
        "host.join",  # once for each code
        "health.worse",
        "health.better",
        "stop.latch",
        "stop.moves",
        "gate.begin",
        "gate.end",
        "go.hold",
        "audit.clock",
        "audit.expire",
        "audit.checkpoint",
        "audit.erase",
        "audit.verify",
        "account.email_refused",
        "setup.admin",
    ),
    "the bridge: at most one task of each kind at a time, by the holder": (
        "speech.start",
        "speech.cancel",
        "drive.start",
        "drive.by",
        "go.start",
        "limb.start",
        "pose.set",
        "motion.start",
        "motion.cancel",
        "head.look_ahead",
        "head.turn",
        "memory.forget",
        "publish.start",
        "topic.choose",
    ),
    "of the person's own account": ("account.single_sign_on",),
    "only staff have the right": (
        "alert.rule",
        "host.code",
        "host.remove",
        "account.email_test",
        "holiday.add",
        "holiday.remove",
        "rule.make",
        "rule.remove",
        "robot.create",
        "robot.change",
        "robot.delete",
        "profile.create",
        "profile.change",
        "profile.delete",
        "phrase.create",
        "phrase.change",
        "phrase.delete",
        "phrase.import",
        "allowance.create",
        "allowance.change",
        "allowance.delete",
        "role.change",
        "group.create",
        "group.change",
        "group.delete",
        "course.create",
        "qualification.create",
        "qualification.change",
        "qualification.delete",
        "account.delete",
        "webhook.create",
        "webhook.pause",
        "webhook.resume",
        "webhook.delete",
    ),
}


def test_each_kind_of_record_has_a_bound():
    counted = {*rates.COUNTED, *(kind for kinds, _did, _most in rates.OFTEN for kind in kinds)}
    otherwise = {kind for kinds in BOUNDED_OTHERWISE.values() for kind in kinds}
    recorded = {kind for kind, facts in KINDS.items() if not facts.former}
    assert recorded - counted - otherwise == set()
    assert otherwise.isdisjoint(counted)
    assert counted | otherwise <= KINDS.keys()


def test_accounts_of_a_list_end_at_their_own_rate(monkeypatch, robot, operator, staff):
    monkeypatch.setattr(
        rates, "OFTEN", ((("account.create",), "made {most} accounts", ((rates.DAY, "day", 3),)),)
    )
    course = Course.objects.create(name="HRI", slug="hri", starts_on=lab_date(), ends_on=lab_date())

    def enrols(actor, *names):
        people = read_people("".join(f"{name} Quill <{name}@example.org>\n" for name in names))
        enrol_list(course=course, people=people, actor=actor, site="")

    enrols(operator, "a", "b")
    with pytest.raises(TooManyChanges, match="made 3 accounts within one day"):
        enrols(operator, "c", "d")
    enrols(operator, "e")
    enrols(staff, "c", "d")
    assert User.objects.filter(full_name__endswith="Quill").count() == 5


def test_an_outcome_is_recorded_whatever_the_rate(most, operator):
    asked = [record("stop.clear", actor=operator) for _ in range(most)]
    with pytest.raises(TooManyChanges), transaction.atomic():
        record("stop.clear", actor=operator)
    record("stop.clear", actor=operator, of=asked[-1], outcome="done")


def test_a_booking_is_cancelled_whatever_the_rate(most, robot, operator, program):
    api = program(operator)
    made = [api("POST", "/bookings", wish(robot, number)).data for number in range(1, most + 2)]
    assert [one.get("code") for one in made][-2:] == ["too_many_changes"] * 2
    assert api("DELETE", f"/bookings/{made[0]['id']}", If_Match='"1"').status_code < 300


def test_yesterdays_changes_count_no_more(most, robot, operator, program, monkeypatch):
    api = program(operator)
    for number in range(1, most + 1):
        api("POST", "/bookings", wish(robot, number))
    assert api("POST", "/bookings", wish(robot, 9)).status_code == 429
    monkeypatch.setattr(rates, "MOST", ((timedelta(0), "hour", most),))
    assert api("POST", "/bookings", wish(robot, 9)).status_code == 201


def test_refused_requests_with_keys_keep_few_rows(robot, operator, program, monkeypatch):
    monkeypatch.setattr(idempotency, "MOST_REFUSED", 5)
    api, records = program(operator), Record.objects.count()
    for number in range(20):
        answer = api("POST", "/bookings", wish(robot, -5), Idempotency_Key=f"key-{number}")
        assert answer.status_code == 409
    assert KeyedRequest.objects.count() == 5
    again = api("POST", "/bookings", wish(robot, -5), Idempotency_Key="key-19")
    assert again["Idempotent-Replayed"] == "true"
    assert Record.objects.count() - records <= 1  # repeats share one record


def test_one_person_has_a_number_of_keys_a_day(robot, operator, program, monkeypatch):
    monkeypatch.setattr(idempotency, "MOST_KEYS", 3)
    api = program(operator)
    answers = [
        api("POST", "/bookings", wish(robot, number), Idempotency_Key=f"key-{number}")
        for number in range(1, 6)
    ]
    assert [answer.status_code for answer in answers] == [201, 201, 201, 429, 429]
    assert (answers[4].data["code"], answers[4].data["figures"]) == ("too_many_keys", {"most": 2000})
    # The kept answer
    assert api("POST", "/bookings", wish(robot, 1), Idempotency_Key="key-1").status_code == 201


def test_a_person_has_a_number_of_sign_ins_at_a_time(operator, monkeypatch):
    monkeypatch.setattr(accounts, "MOST_SIGN_INS", 3)
    browsers = [Client() for _ in range(5)]
    for browser in browsers:
        assert browser.login(username=operator.username, password=PASSWORD)
    assert SignIn.objects.filter(user=operator).count() == 3
    assert [browser.get("/").status_code for browser in browsers] == [401, 401, 200, 200, 200]


def test_cancelled_bookings_are_removed_when_no_report_needs_them(robot, operator, program):
    api = program(operator)
    made = api("POST", "/bookings", wish(robot)).data
    api("DELETE", f"/bookings/{made['id']}", If_Match='"1"')
    remove_old_cancelled(clock.now() + CANCELLED_KEPT)
    assert Booking.objects.get().state == State.CANCELLED
    remove_old_cancelled(clock.now() + CANCELLED_KEPT + timedelta(days=1))
    assert not Booking.objects.exists()


def test_only_the_latest_cancelled_bookings_of_a_person_stay(robot, operator, program, monkeypatch):
    monkeypatch.setattr(services, "MOST_CANCELLED", 2)
    api = program(operator)
    made = [api("POST", "/bookings", wish(robot, number)).data["id"] for number in (1, 2, 3, 4)]
    for booking in made[:3]:
        api("DELETE", f"/bookings/{booking}", If_Match='"1"')
    remove_old_cancelled(clock.now())
    assert [str(one.pk) for one in Booking.objects.order_by("starts_at")] == made[1:]
