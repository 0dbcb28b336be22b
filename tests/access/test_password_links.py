"""Personal links to set a password: who may see which, on what page, and when they end."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from allauth.mfa.models import Authenticator
from django.core import mail
from django.test import Client
from django.utils import timezone

from fleet.accounts.mail import off
from fleet.accounts.models import User
from fleet.accounts.sign_in import throttle
from fleet.audit.models import Record
from robots.access.enrolment import enrol, enrol_list, invitation_make
from robots.access.models import Course, Enrolment, PasswordLink, Qualification, QualificationGrant
from robots.access.password_links import codes_of, link_of, may_see, untouched
from robots.access.people_lists.reading import read_people
from robots.access.services import qualification_grant
from robots.registry.models import Robot, RobotRole, Role
from tests.conftest import PASSWORD

SignIn = Callable[[User], Client]
FORM = {"new_password1": PASSWORD, "new_password2": PASSWORD}


def newcomer(name: str, *courses: Course) -> User:
    person = User(username=name, full_name=name.title(), email=f"{name}@example.org")
    person.set_unusable_password()
    person.save()
    for course in courses:
        Enrolment.objects.create(course=course, person=person)
    return person


@pytest.fixture
def ada(course: Course) -> User:
    return newcomer("ada", course)


@pytest.fixture
def no_mail(settings: Any) -> None:
    settings.EMAIL_BACKEND = off.BACKEND


def codes_in(response: Any) -> list[str]:
    return re.findall(r"/welcome/([a-z2-9-]+)/", response.text)


# --- pages ----------------------------------------------------------------------------------------


def test_a_supervisor_prints_the_links_of_all_who_have_none(
    signed_in: SignIn, teacher: User, student: User, course: Course, ada: User
) -> None:
    newcomer("bob", course)
    by_single_sign_on = newcomer("cy", course)
    User.objects.filter(pk=by_single_sign_on.pk).update(last_login=timezone.now())
    client = signed_in(teacher)
    assert "Links to set a password: 2 people" in client.get("/courses/hri-2026/").text
    sheet = client.post("/courses/hri-2026/links/")
    first, second = codes_in(sheet)
    assert sheet.text.count("<svg") >= 2 and "Ada" in sheet.text and student.full_name not in sheet.text
    assert "no-store" in sheet["Cache-Control"]
    assert codes_in(client.post("/courses/hri-2026/links/", {"person": [str(ada.pk)]})) == [first]
    assert Client().post(f"/welcome/{first}/", FORM).url == "/"
    assert Client().login(username="ada", password=PASSWORD)
    assert Client().post(f"/welcome/{first}/", FORM).status_code == 410
    assert codes_in(client.post("/courses/hri-2026/links/")) == [second]
    shown = Record.objects.filter(kind="account.link", actor_id=str(teacher.pk))
    assert [len(one.parameters["people"]) for one in shown.order_by("pk")] == [2, 1, 1]
    assert first not in str([one.parameters for one in Record.objects.all()])


def test_new_links_end_the_old_ones(signed_in: SignIn, teacher: User, course: Course, ada: User) -> None:
    client = signed_in(teacher)
    [old] = codes_in(client.post("/courses/hri-2026/links/"))
    [new] = codes_in(client.post("/courses/hri-2026/links/", {"anew": "1"}))
    assert old != new
    assert (link_of(old), link_of(new).person) == (None, ada)
    PasswordLink.objects.update(expires_at=timezone.now())
    assert link_of(new) is None


def test_staff_show_a_link_for_a_forgotten_password(
    signed_in: SignIn, staff: User, operator: User, supervisor: User, robot: Robot
) -> None:
    client, theirs = signed_in(staff), signed_in(operator)
    [code] = codes_in(client.post(f"/people/{operator.pk}/link/"))
    new = {"new_password1": "another long walk", "new_password2": "another long walk"}
    assert Client().post(f"/welcome/{code}/", new).status_code == 302
    assert theirs.get("/access/").status_code == 401  # signed out
    assert client.post(f"/people/{staff.pk}/link/").status_code == 404
    assert signed_in(supervisor).post(f"/people/{operator.pk}/link/").status_code == 404


def test_the_link_is_of_use_once_also_for_two_at_once(ada: User) -> None:
    code = codes_of([ada])[ada.pk]
    link = link_of(code)
    PasswordLink.objects.filter(pk=link.pk).delete()  # another was faster
    assert Client().post(f"/welcome/{code}/", FORM).status_code == 410
    assert not User.objects.get(pk=ada.pk).has_usable_password()


# --- no takeover ----------------------------------------------------------------------------------


@pytest.fixture
def other_course(course: Course) -> Course:
    return Course.objects.create(
        name="Other", slug="other", starts_on=course.starts_on, ends_on=course.ends_on
    )


def _role(person: User, robot: Robot, **_: Any) -> None:
    RobotRole.objects.create(robot=robot, user=person, role=Role.SUPERVISOR)


CHANGES: dict[str, Callable[..., Any]] = {
    "staff": lambda person, **_: User.objects.filter(pk=person.pk).update(is_staff=True),
    "a password": lambda person, **_: (person.set_password(PASSWORD), person.save()),
    "signed in before, such as by single sign-on": lambda person, **_: User.objects.filter(
        pk=person.pk
    ).update(last_login=timezone.now()),
    "an own role": _role,
    "supervises a course": lambda person, other, **_: other.supervisors.add(person),
    "closed": lambda person, **_: User.objects.filter(pk=person.pk).update(is_active=False),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_supervisor_gets_no_account_that_has_more_than_enrolments(
    what: str, teacher: User, staff: User, other_course: Course, robot: Robot, ada: User
) -> None:
    assert may_see(teacher, [ada]) == {ada.pk}
    code = codes_of([ada], seen=True)[ada.pk]
    assert link_of(code).person == ada
    CHANGES[what](ada, robot=robot, other=other_course)
    changed = User.objects.get(pk=ada.pk)
    assert may_see(teacher, [changed]) == set()
    assert link_of(code) is None
    assert may_see(staff, [changed]) == ({ada.pk} if what != "closed" else set())


def test_a_supervisor_gets_no_rights_of_another_course(
    signed_in: SignIn, teacher: User, other_course: Course, course: Course, ada: User
) -> None:
    eve = newcomer("eve", course, other_course)
    sheet = signed_in(teacher).post("/courses/hri-2026/links/")
    assert len(codes_in(sheet)) == 1 and "shown to staff only" in sheet.text and "Eve" in sheet.text
    Course.objects.filter(pk=other_course.pk).update(archived=True)
    assert untouched([eve], {course.pk}) == {eve.pk}
    assert may_see(teacher, [newcomer("mallory")]) == set()  # in no course of theirs


def _qualification(person: User, by: User) -> None:
    exam, _made = Qualification.objects.get_or_create(name="Exam", slug="exam")
    qualification_grant(qualification=exam, people=[person], expires_at=None, actor=by)


GAINS: dict[str, Callable[..., Any]] = {
    "an enrolment": lambda person, staff, other, **_: enrol(course=other, people=[person], actor=staff),
    "a qualification": lambda person, staff, **_: _qualification(person, staff),
    "a supervisor's role": lambda person, robot, **_: _role(person, robot),
}


@pytest.mark.parametrize("what", GAINS)
@pytest.mark.parametrize("viewer", ["teacher", "staff", "whoever opens the invitation"])
def test_a_seen_link_ends_when_its_account_gains_by_other_hands(
    what: str,
    viewer: str,
    signed_in: SignIn,
    teacher: User,
    course: Course,
    other_course: Course,
    robot: Robot,
    join: str,
    ada: User,
) -> None:
    chief = User.objects.create_user("chief", is_staff=True)
    if viewer == "whoever opens the invitation":
        sheet = Client().post(join, {"known_as": "ada@example.org"}, follow=True)
        code = sheet.redirect_chain[-1][0].split("/")[2]
    else:
        client = signed_in(teacher if viewer == "teacher" else User.objects.create_user("s", is_staff=True))
        [code] = codes_in(client.post(f"/people/{ada.pk}/link/"))
    unseen = codes_of([newcomer("eve", course)])
    assert link_of(code).person == ada
    for person in User.objects.filter(pk__in=[ada.pk, *unseen]):
        GAINS[what](person, staff=chief, other=other_course, robot=robot)
    assert link_of(code) is None
    assert Client().post(f"/welcome/{code}/", FORM).status_code == 410
    assert all(link_of(one) for one in unseen.values())  # e-mailed: nobody else has it
    [new] = codes_in(signed_in(chief).post(f"/people/{ada.pk}/link/"))
    assert new != code and link_of(new).person == ada


def test_own_hands_do_not_end_a_link_until_another_has_seen_it(
    signed_in: SignIn, staff: User, teacher: User, ada: User
) -> None:
    [code] = codes_in(signed_in(teacher).post(f"/people/{ada.pk}/link/"))
    _qualification(ada, teacher)
    assert codes_in(signed_in(teacher).post(f"/people/{ada.pk}/link/")) == [code]
    assert codes_in(signed_in(staff).post(f"/people/{ada.pk}/link/")) == [code]
    assert link_of(code).person == ada
    QualificationGrant.objects.all().delete()
    _qualification(ada, teacher)
    assert link_of(code) is None


def test_a_sign_in_ends_every_link(ada: User) -> None:
    code = codes_of([ada])[ada.pk]
    Client().force_login(ada)
    assert link_of(code) is None


# --- signed in at once ----------------------------------------------------------------------------


def test_who_sets_a_password_by_a_link_is_signed_in(ada: User) -> None:
    client = Client()
    client.get("/")
    answer = client.post(f"/welcome/{codes_of([ada])[ada.pk]}/", FORM, follow=True)
    assert "Your user name is ada" in answer.text and answer.wsgi_request.user == ada
    assert Record.objects.filter(kind="account.sign_in", actor_id=str(ada.pk)).count() == 1
    assert ada.sign_ins.count() == 1


def test_a_second_factor_is_asked_for_after_a_link(ada: User, staff: User) -> None:
    Authenticator.objects.create(user=ada, type=Authenticator.Type.TOTP, data={"secret": "x"})
    client = Client()
    answer = client.post(f"/welcome/{codes_of([ada])[ada.pk]}/", FORM)
    assert "second-factor" in answer.url and client.get("/access/").status_code == 401


def test_a_link_signs_nobody_else_out(signed_in: SignIn, teacher: User, ada: User) -> None:
    client = signed_in(teacher)
    assert client.post(f"/welcome/{codes_of([ada])[ada.pk]}/", FORM).url == "/"
    assert client.get("/access/").wsgi_request.user == teacher
    assert Client().login(username="ada", password=PASSWORD)


# --- no mail server -------------------------------------------------------------------------------


def test_without_mail_server_pages_say_so_and_no_log_has_a_link(
    no_mail: None,
    signed_in: SignIn,
    staff: User,
    course: Course,
    caplog: pytest.LogCaptureFixture,
    django_capture_on_commit_callbacks: Any,
) -> None:
    client = signed_in(staff)
    caplog.set_level(logging.INFO)
    with django_capture_on_commit_callbacks(execute=True):
        enrol_list(course=course, people=read_people("Ada,ada@example.org"), actor=staff, site="https://f")
        preview = client.post("/courses/hri-2026/enrol/", {"people": "Bob,bob@example.org"})
    assert "so nobody gets an e-mail" in preview.text and "and an e-mail" not in preview.text
    page = client.get("/courses/hri-2026/").text
    assert "no mail server" in page and "Send the e-mail" not in page
    for path in ("/accounts/password/forgotten/", "/accounts/email/", "/bookings/mine/", "/mail/"):
        assert re.search("no mail server|sends no e-mails", client.get(path, follow=True).text), path
    mail.EmailMessage("Secret", "https://f/welcome/abc", to=["ada@example.org"]).send()
    assert "No e-mail to ada@example.org" in caplog.text and "welcome" not in caplog.text


def test_staff_test_the_mail_server(
    signed_in: SignIn, staff: User, teacher: User, settings: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = signed_in(staff)
    assert "took the e-mail to me@example.org" in client.post("/mail/", {"to": "me@example.org"}).text
    assert [one.to for one in mail.outbox] == [["me@example.org"]]

    def refuse(*_arguments: Any, **_options: Any) -> int:
        raise OSError("connection refused by mail.example.org")

    monkeypatch.setattr(mail.backends.locmem.EmailBackend, "send_messages", refuse)
    assert "refused by mail.example.org" in client.post("/mail/", {"to": "me@example.org"}).text
    assert "letters that no page sends have no links" in client.get("/mail/").text
    settings.FLEET_ORIGINS = ["https://fleet.example:8443"]
    page = client.get("/mail/").text
    assert "https://fleet.example:8443" in page and "have no links" not in page
    outcomes = Record.objects.filter(kind="account.email_test").order_by("pk")
    assert [one.outcome for one in outcomes] == ["sent", "failed"]
    assert signed_in(teacher).get("/mail/").status_code == 403


# --- an invitation finds the person ---------------------------------------------------------------


@pytest.fixture
def join(course: Course, teacher: User) -> str:
    ends = timezone.now() + timedelta(days=1)
    made = invitation_make(course=course, expires_at=ends, most_uses=9, actor=teacher)
    return f"/join/{made.code}/"


@pytest.mark.parametrize("typed", ["ADA@example.org", " 007 "])
def test_an_invitation_finds_the_person_of_the_list(typed: str, join: str, course: Course, ada: User) -> None:
    Enrolment.objects.filter(person=ada).update(number="007")
    client = Client()
    assert 'name="known_as"' in client.get(join).text
    page = client.post(join, {"known_as": typed}, follow=True)
    assert "Welcome, Ada" in page.text
    assert client.post(page.redirect_chain[-1][0], FORM).url == "/"
    assert client.get("/access/").status_code == 200  # signed in
    assert Client().login(username="ada", password=PASSWORD)
    assert User.objects.filter(full_name="Ada").count() == 1
    shown = Record.objects.get(kind="account.link")
    assert (shown.actor_id, shown.parameters["people"]) == (None, [str(ada.pk)])
    again = Client().post(join, {"known_as": typed})
    assert again.status_code == 409 and "sign in with it" in again.text


@pytest.mark.parametrize("what", [*CHANGES, "another course"])
def test_an_invitation_gives_no_account_with_more_rights(
    what: str, join: str, other_course: Course, robot: Robot, ada: User
) -> None:
    if what == "another course":
        Enrolment.objects.create(course=other_course, person=ada)
    else:
        CHANGES[what](ada, robot=robot, other=other_course)
    answer = Client().post(join, {"known_as": "ada@example.org"})
    assert answer.status_code == 409
    assert not PasswordLink.objects.exists()


def test_an_invitation_gives_no_account_with_a_qualification(join: str, staff: User, ada: User) -> None:
    exam = Qualification.objects.create(name="Exam", slug="exam")
    qualification_grant(qualification=exam, people=[ada], expires_at=None, actor=staff)
    assert Client().post(join, {"known_as": "ada@example.org"}).status_code == 409
    assert not PasswordLink.objects.exists()


def test_an_invitation_says_nothing_of_people_outside_the_course(join: str, ada: User) -> None:
    newcomer("eve")
    known, unknown = (
        Client().post(join, {"known_as": f"{name}@example.org"}).text for name in ("eve", "nobody")
    )
    assert "Nobody on the course’s list" in known
    assert re.sub(r'value="[^"]+"', "", known) == re.sub(r'value="[^"]+"', "", unknown)


def test_guesses_of_numbers_are_limited(join: str, ada: User, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(throttle, "FAILURES_OF_ADDRESS", 2)
    answers = [Client().post(join, {"known_as": str(number)}).status_code for number in range(4)]
    assert answers == [409, 409, 429, 429]


def test_a_second_account_of_a_name_is_asked_about(join: str, course: Course, ada: User) -> None:
    User.objects.filter(pk=ada.pk).update(full_name="Ada Lovelace")
    form = {"full_name": "Lovelace Ada", "username": "al", "password1": PASSWORD, "password2": PASSWORD}
    asked = Client().post(join, form)
    assert asked.status_code == 400 and 'name="another"' in asked.text
    assert not User.objects.filter(username="al").exists()
    assert Client().post(join, {**form, "another": "1"}).status_code == 302
    assert Enrolment.objects.filter(course=course, person__username="al").exists()


def test_without_a_list_an_invitation_asks_for_a_new_account_at_once(join: str, student: User) -> None:
    assert 'name="username"' in Client().get(join).text
