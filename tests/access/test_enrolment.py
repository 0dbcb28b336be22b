"""Enrolment by list and by invitation, and its end. Accounts are made once and recorded."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from typing import Any

import pytest
from django.core import mail
from django.db import connections
from django.utils import timezone

from fleet.accounts import emails
from fleet.accounts.models import User
from fleet.accounts.services import account_erase
from fleet.audit.models import Record
from robots.access.enrolment import (
    EnrolmentRefused,
    check_invitation,
    enrol_list,
    invitation_accept,
    invitation_make,
    invitation_of,
    invitation_revoke,
    plan_of,
    unenrol,
)
from robots.access.models import Course, Enrolment
from robots.access.password_links import link_of
from robots.access.people_lists.reading import read_people
from robots.access.selectors import role_on
from robots.registry.models import Robot, Role

SITE = "https://fleet.example.org"


@pytest.fixture
def enrol(course: Course, staff: User) -> Callable[[str], Any]:
    return lambda text: enrol_list(course=course, people=read_people(text), actor=staff, site=SITE)


def test_a_list_enrols_known_people_and_makes_accounts(
    enrol: Callable[[str], Any], course: Course, student: User, stranger: User, robot: Robot
) -> None:
    User.objects.filter(pk=student.pk).update(email="stu@example.org")
    User.objects.filter(pk=stranger.pk).update(email="stig@example.org")
    text = "Stig,stig@example.ORG\nStu,stu@example.org\nAda Lovelace,Ada@example.org\nBob,bob"
    for first in (True, False):
        plan = enrol(text)
        assert (len(plan.known), len(plan.new), len(plan.enrolled)) == ((1, 1, 1) if first else (0, 0, 3))
        assert [one.line for one in plan.wrong] == [4]
    assert Enrolment.objects.filter(course=course).count() == 3
    ada = User.objects.get(username="ada@example.org")
    assert (ada.full_name, ada.email, ada.has_usable_password()) == ("Ada Lovelace", "ada@example.org", False)
    assert role_on(ada, robot) is role_on(stranger, robot) is Role.OPERATOR
    assert Record.objects.get(kind="account.create", parameters__user=str(ada.pk)).content.data["name"]
    enrolled = Record.objects.filter(kind="course.enrol")
    assert sum(len(record.parameters["people"]) for record in enrolled) == 2


def test_a_closed_account_is_a_wrong_line(course: Course, stranger: User, staff: User) -> None:
    User.objects.filter(pk=stranger.pk).update(email="stig@example.org", is_active=False)
    plan = plan_of(read_people("y,stig@example.org"), course, staff)
    assert [(one.line, one.reason) for one in plan.wrong] == [(1, "This account is closed. Ask the staff.")]
    assert not plan.to_enrol


def test_user_names_stay_unique(enrol: Callable[[str], Any]) -> None:
    User.objects.create_user("ada@example.org")
    enrol("Ada,ada@example.org\nO'Neil,o'neil@example.org\nONeil,o-neil@example.org")
    names = {user.email: user.username for user in User.objects.exclude(email="")}
    assert names == {
        "ada@example.org": "ada@example.org-2",
        "o'neil@example.org": "o-neil@example.org",
        "o-neil@example.org": "o-neil@example.org-2",
    }


def test_new_people_get_a_link_that_ends_with_their_password(
    enrol: Callable[[str], Any], django_capture_on_commit_callbacks: Any
) -> None:
    with django_capture_on_commit_callbacks(execute=True):
        enrol("Ada,ada@example.org")
    _wait_for(lambda: len(mail.outbox) == 1)
    ada = User.objects.get(username="ada@example.org")
    [message] = mail.outbox
    assert message.to == ["ada@example.org"]
    code = message.body.split("/welcome/")[1].split("/")[0]
    assert message.body.count(f"{SITE}/welcome/") == 1
    assert link_of(code).person == ada
    assert link_of(code[:-1]) is None
    ada.set_password("a long walk on the beach")
    ada.save()
    assert link_of(code) is None


@pytest.mark.django_db(transaction=True)
def test_a_button_pressed_twice_makes_each_account_once(enrol: Callable[[str], Any], course: Course) -> None:
    text = "\n".join(f"Student {number},s{number}@example.org" for number in range(150))
    begin = threading.Barrier(3)

    def press() -> None:
        begin.wait(10)
        try:
            enrol(text)
        finally:
            connections.close_all()

    with ThreadPoolExecutor(3) as presses:
        for done in [presses.submit(press) for _ in range(3)]:
            done.result(60)
    assert User.objects.filter(email__endswith="@example.org").count() == 150
    assert Enrolment.objects.filter(course=course).count() == 151


def test_a_mail_server_that_hangs_delays_nobody(
    enrol: Callable[[str], Any],
    settings: Any,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    django_capture_on_commit_callbacks: Any,
) -> None:
    monkeypatch.setattr(emails, "SERVER_TIMEOUT_S", 0.5)
    monkeypatch.setattr(emails, "AGAIN_S", ())
    settings.EMAIL_BACKEND = "django.core.mail.backends.smtp.EmailBackend"
    with socket.create_server(("127.0.0.1", 0)) as server:  # accepts connections, sends nothing
        settings.EMAIL_HOST, settings.EMAIL_PORT = server.getsockname()[:2]
        begun_s = time.monotonic()
        with django_capture_on_commit_callbacks(execute=True):
            enrol("Ada,ada@example.org")
        assert time.monotonic() - begun_s < 0.5
        _wait_for(lambda: "E-mails were not sent" in caplog.text)


def test_leaving_a_course_ends_its_role(course: Course, student: User, robot: Robot, staff: User) -> None:
    assert unenrol(course=course, people=[student], actor=staff) == 1
    assert unenrol(course=course, people=[student], actor=staff) == 0
    assert role_on(student, robot) is None
    assert Record.objects.filter(kind="course.unenrol").count() == 1


# --- invitations ----------------------------------------------------------------------------------


def test_an_invitation_enrols_until_it_is_used_up(
    course: Course, stranger: User, operator: User, teacher: User
) -> None:
    now = timezone.now()
    made = invitation_make(course=course, expires_at=now + timedelta(days=1), most_uses=1, actor=teacher)
    found = invitation_of(made.code)
    assert found == made
    assert invitation_accept(invitation=made, person=stranger, now=now)
    assert not invitation_accept(invitation=made, person=stranger, now=now)
    with pytest.raises(EnrolmentRefused) as refused:
        invitation_accept(invitation=made, person=operator, now=now)
    assert refused.value.refusal.code == "invitation_used"


def test_an_invitation_ends(course: Course, teacher: User) -> None:
    now = timezone.now()
    made = invitation_make(course=course, expires_at=now + timedelta(days=1), most_uses=5, actor=teacher)

    def code(at: Any = now) -> str | None:
        refusal = check_invitation(invitation_of(made.code), at)
        return refusal and refusal.code

    assert code() is None
    assert code(now + timedelta(days=1)) == "invitation_expired"
    Course.objects.update(starts_on="2020-01-01", ends_on="2020-02-01")
    assert code() == "course_over"
    invitation_revoke(invitation=made, actor=teacher)
    assert code() == "invitation_revoked"
    assert invitation_of(str(made.pk)) is None
    assert invitation_of(made.code[:-1]) is None


def _wait_for(done: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 5.0
    while not done():
        assert time.monotonic() < deadline_s
        time.sleep(0.01)


# --- student numbers ------------------------------------------------------------------------------


def numbers_in(course: Course) -> dict[str, str]:
    rows = Enrolment.objects.filter(course=course).exclude(number="")
    return dict(rows.values_list("person__full_name", "number"))


def test_numbers_are_kept_with_the_enrolment_and_find_people_again(
    enrol: Callable[[str], Any], course: Course
) -> None:
    enrol("Name;E-Mail\nAda Lovelace;ada@example.org")
    plan = enrol("Name;E-Mail;Student ID\nAda Lovelace;ada@example.org;0070070\nBo Ek;bo@example.org;8")
    assert (len(plan.renumbered), len(plan.new)) == (1, 1)
    assert numbers_in(course) == {"Ada Lovelace": "0070070", "Bo Ek": "8"}
    again = enrol('Student ID;Name\n0070070;"Lovelace, Ada"\n9;Cy Ek')  # without addresses
    assert (len(again.enrolled), len(again.new)) == (1, 1)
    assert User.objects.get(full_name="Cy Ek").username == "9"
    assert not enrol("Student ID;Name\n9;Cy Ek").to_enrol
    recorded = Record.objects.filter(kind="course.number")
    assert [len(one.parameters["people"]) for one in recorded.order_by("pk")] == [1, 1, 1]
    assert "0070070" not in str([(one.parameters, one.details) for one in Record.objects.all()])


def test_two_people_never_have_one_number(enrol: Callable[[str], Any], course: Course) -> None:
    enrol("Name;E-Mail;Student ID\nAda Lovelace;ada@example.org;7")
    plan = enrol("Name;E-Mail;Student ID\nEve Ek;eve@example.org;7")
    assert [one.reason for one in plan.wrong] == ["Ada Lovelace has this student number in the course."]
    assert numbers_in(course) == {"Ada Lovelace": "7"}


def test_a_number_finds_nobody_of_another_supervisors_course(
    course: Course, teacher: User, staff: User, enrol: Callable[[str], Any]
) -> None:
    other = Course.objects.create(
        name="Other", slug="other", starts_on=course.starts_on, ends_on=course.ends_on
    )
    enrol_list(course=other, people=read_people("Student ID;Name\n7;Ada Ek"), actor=staff, site=SITE)
    mine = plan_of(read_people("Student ID;Name\n7;Ada Ek"), course, teacher)
    assert (mine.known, [one.account for one in mine.undisclosed]) == ((), [None])
    assert [one.full_name for one in plan_of(read_people("Student ID;Name\n7;Ada Ek"), course, staff).known]
    assert not plan_of(read_people("Student ID;Name\n7;Bo Ek"), course, staff).known  # another name


def test_an_erased_persons_number_is_gone(enrol: Callable[[str], Any], course: Course, staff: User) -> None:
    enrol("Student ID;Name\n7;Ada Ek")
    account_erase(user=User.objects.get(username="7"), actor=staff)
    assert numbers_in(course) == {}
