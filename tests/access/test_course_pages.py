"""The pages of courses: make one with its people, manage it, join it, and see the reason for a right."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from datetime import timedelta
from smtplib import SMTPRecipientsRefused
from typing import Any

import pytest
from django.core.files.uploadedfile import SimpleUploadedFile
from django.core.mail import EmailMessage
from django.core.mail.backends.locmem import EmailBackend
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.access.enrolment import invitation_make
from robots.access.models import (
    Course,
    Enrolment,
    GroupRole,
    Invitation,
    Qualification,
    QualificationGrant,
    RobotGroup,
)
from robots.access.password_links import codes_of
from robots.access.selectors import lab_date, missing_qualifications, role_on
from robots.registry.models import Robot, Role
from tests.access.test_people_lists import ROWS, STRINGS, workbook
from tests.conftest import PASSWORD

SignIn = Callable[[User], Client]


def shown(response: Any) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", response.content.decode()))


def seen_in(response: Any) -> str:
    return re.search(r'name="seen" value="(\w+)"', response.content.decode())[1]


def form_of(preview: Any) -> dict[str, Any]:
    """Return the fields with which a browser would send a preview."""
    form, columns = preview.context["form"], preview.context["columns"]
    return {
        "people": form["people"].value() or "",
        "content": form["content"].value() or "",
        "file_name": form["file_name"].value() or "",
        "encoding": form["encoding"].value() or "",
        "separator": preview.context["separator"],
        "separator_before": preview.context["separator"],
        "encoding_before": form["encoding"].value() or "",
        "column": [column["role"] for column in columns],
        "seen": seen_in(preview),
    }


@pytest.fixture
def new_course(robot: Robot, other_robot: Robot, teacher: User) -> dict[str, Any]:
    group = RobotGroup.objects.create(name="Others", slug="others")
    group.robots.add(other_robot)
    return {
        "name": "Robotics 1",
        "starts_on": lab_date().isoformat(),
        "ends_on": (lab_date() + timedelta(days=100)).isoformat(),
        "robots": [str(robot.pk)],
        "groups": [str(group.pk)],
        "role": "operator",
        "supervisors": "teacher",
        "week_hours": "2.5",
        "people": "\n".join(f"Student {number} <s{number}@example.org>" for number in range(40)),
    }


def test_one_form_makes_a_class_of_forty(
    signed_in: SignIn, staff: User, teacher: User, new_course: dict[str, Any], other_robot: Robot
) -> None:
    client = signed_in(staff)
    preview = client.post("/courses/new/", new_course)
    assert "40 people get an account" in shown(preview)
    assert not Course.objects.exists()
    made = client.post("/courses/new/", {**new_course, "seen": seen_in(preview)})
    assert made.status_code == 302, shown(made)
    course = Course.objects.get()
    assert (course.slug, course.week_min, list(course.supervisors.all())) == ("robotics-1", 150, [teacher])
    student = User.objects.get(email="s39@example.org")
    assert role_on(student, other_robot) is Role.OPERATOR
    assert Record.objects.filter(kind="course.create", actor_id=str(staff.pk)).count() == 1
    assert "40 people" in shown(client.get(made.url))


def test_a_list_that_changed_after_the_preview_is_shown_again(
    signed_in: SignIn, staff: User, new_course: dict[str, Any]
) -> None:
    client = signed_in(staff)
    seen = seen_in(client.post("/courses/new/", new_course))
    again = client.post("/courses/new/", {**new_course, "people": "Eve <eve@example.org>", "seen": seen})
    assert "1 person gets an account" in shown(again)
    assert not Course.objects.exists()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"ends_on": "2020-01-01"}, "The last day must not be before the first day"),
        ({"robots": [], "groups": []}, "Choose at least one robot or group."),
        ({"supervisors": "nobody"}, "nobody is not the name of one open account."),
        ({"week_hours": "-1"}, "greater than or equal to 0.25"),
        ({"name": ""}, "This field is required."),
    ],
)
def test_a_wrong_course_is_refused_in_words(
    change: dict[str, Any], text: str, signed_in: SignIn, staff: User, new_course: dict[str, Any]
) -> None:
    answer = signed_in(staff).post("/courses/new/", {**new_course, **change})
    assert answer.status_code == 400
    assert text in shown(answer)


def test_staff_change_and_archive_a_course(
    signed_in: SignIn, staff: User, course: Course, student: User, robot: Robot, new_course: dict[str, Any]
) -> None:
    client = signed_in(staff)
    assert 'value="HRI 2026"' in client.get("/courses/hri-2026/edit/").content.decode()
    fields = {name: value for name, value in new_course.items() if name != "people"}
    assert client.post("/courses/hri-2026/edit/", fields).status_code == 302
    [changed] = Record.objects.filter(kind="course.change")
    fields = {one["field"] for one in changed.parameters["changes"]}
    assert fields == {"name", "ends_on", "week_min", "groups"}
    client.post("/courses/hri-2026/archive/", {"archived": "1"})
    assert role_on(student, robot) is None
    client.post("/courses/hri-2026/archive/", {"archived": "0"})
    assert role_on(student, robot) is Role.OPERATOR


# --- a file outlives an error ---------------------------------------------------------------------


def test_a_chosen_list_is_kept_when_the_form_is_refused(
    signed_in: SignIn, staff: User, new_course: dict[str, Any]
) -> None:
    client, file = signed_in(staff), SimpleUploadedFile("class.csv", "Zoë <z@example.org>".encode("cp1252"))
    fields = {**new_course, "people": ""}
    refused = client.post("/courses/new/", {**fields, "robots": [], "groups": [], "file": file})
    assert refused.status_code == 400
    words = shown(refused).replace("\xa0", " ")
    assert "Choose at least one robot or group." in words
    assert "The file class.csv (19 bytes) is still here." in words
    assert "1 person gets an account" in words
    kept = {**fields, "content": refused.context["form"]["content"].value(), "file_name": "class.csv"}
    assert "Please check the list" in shown(client.post("/courses/new/", kept))  # not seen yet
    assert client.post("/courses/new/", {**fields, **form_of(refused)}).status_code == 302
    assert User.objects.get(email="z@example.org").full_name == "Zoë"


@pytest.mark.parametrize("content", [b"PK\x03\x04 and so on", b"", b"Name;E-Mail\n", b"x" * 1_500_001])
def test_nothing_goes_on_without_a_file_that_was_refused(
    content: bytes, signed_in: SignIn, staff: User, new_course: dict[str, Any]
) -> None:
    client, fields = signed_in(staff), {**new_course, "people": ""}
    refused = client.post("/courses/new/", {**fields, "file": SimpleUploadedFile("class.csv", content)})
    form = refused.context["form"]
    again = {**fields, **{name: form[name].value() or "" for name in ("content", "file_name")}}
    answer = client.post("/courses/new/", again)
    assert answer.status_code == 400
    assert not Course.objects.exists()
    assert client.post("/courses/new/", {**again, "without_file": "on"}).status_code == 302


def test_a_pasted_list_beside_a_file_is_said_to_be_unused(
    signed_in: SignIn, course: Course, teacher: User
) -> None:
    file = SimpleUploadedFile("class.csv", b"a@example.org")
    both = signed_in(teacher).post("/courses/hri-2026/enrol/", {"file": file, "people": "b@example.org"})
    assert "The pasted list is not used: the file is." in shown(both)


# --- supervisors ----------------------------------------------------------------------------------


def test_a_supervisor_enrols_by_csv_after_a_preview(signed_in: SignIn, course: Course, teacher: User) -> None:
    client = signed_in(teacher)
    content = "Name;Nr;E-Mail\nJürgen;7;j@example.org\nBob;8;bob\n".encode("latin-1")
    file = SimpleUploadedFile("class.csv", content)
    preview = client.post("/courses/hri-2026/enrol/", {"file": file})
    words = shown(preview)
    assert "Left out: Nr." in words
    assert "3 Left out: bob is no e-mail address. Bob 8 bob" in " ".join(words.split())
    assert Enrolment.objects.count() == 1
    for _twice in range(2):
        done = client.post("/courses/hri-2026/enrol/", form_of(preview))
        assert done.status_code == 302
    assert User.objects.get(email="j@example.org").full_name == "Jürgen"
    assert Enrolment.objects.count() == 2


def test_a_registrys_file_is_shown_as_it_will_be_stored(
    signed_in: SignIn, course: Course, teacher: User
) -> None:
    client, address = signed_in(teacher), "/courses/hri-2026/enrol/"
    content = "Robotics 1\n\nKey\tWho\tE-Mail\n007\tMüller, Zoë\tz@example.org\n".encode("utf-16")
    preview = client.post(address, {"file": SimpleUploadedFile("class.txt", content)})
    assert "UTF-16" in shown(preview) and "It stands above the titles" in shown(preview)
    named = {**form_of(preview), "column": ["number", "last_first", "email"], "again": "1"}
    preview = client.post(address, named)
    assert re.search(r"Zoë Müller.*?</td><td>z@example.org</td><td>007</td>", preview.text)
    assert client.post(address, form_of(preview)).status_code == 302
    assert Enrolment.objects.get(number="007").person.full_name == "Zoë Müller"
    assert "z@example.org · 007" in shown(client.get("/courses/hri-2026/"))


def test_a_workbook_is_shown_as_it_will_be_stored(signed_in: SignIn, course: Course, teacher: User) -> None:
    client, address = signed_in(teacher), "/courses/hri-2026/enrol/"
    file = SimpleUploadedFile("class.xlsx", workbook(ROWS, STRINGS, sheets=2))
    preview = client.post(address, {"file": file})
    words = shown(preview)
    assert "Only the first sheet" in words and "Encoding" not in words and "Separator" not in words
    fields = {**form_of(preview), "separator": "", "separator_before": ""}
    turned = {**fields, "column": ["number", "name", "email"], "again": "1"}
    assert "<td>Lovelace, Ada" in client.post(address, turned).text
    assert client.post(address, fields).status_code == 302
    assert Enrolment.objects.get(number="123456789012").person.full_name == "Ada Lovelace"


def test_a_list_asks_about_people_who_have_joined_by_themselves(
    signed_in: SignIn, course: Course, teacher: User
) -> None:
    listed = "Stu Dent <s@example.org>\nDent <d@example.org>"
    preview = shown(signed_in(teacher).post("/courses/hri-2026/enrol/", {"people": listed}))
    assert preview.count("the same person?") == 1


@pytest.mark.django_db(transaction=True)
def test_the_page_shows_whom_the_welcome_letter_did_not_reach(
    signed_in: SignIn, course: Course, teacher: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse_ada(_server: EmailBackend, letters: list[EmailMessage]) -> int:
        if letters[0].to == ["ada@example.org"]:
            raise SMTPRecipientsRefused({"ada@example.org": (550, b"5.1.1 no such mailbox")})
        return 1

    monkeypatch.setattr(EmailBackend, "send_messages", refuse_ada)
    client, address = signed_in(teacher), "/courses/hri-2026/enrol/"
    preview = client.post(address, {"people": "Ada <ada@example.org>\nBob <bob@example.org>"})
    assert client.post(address, form_of(preview)).status_code == 302
    for thread in threading.enumerate():
        if thread.name == "email":
            thread.join(10)
    words = shown(client.get("/courses/hri-2026/"))
    assert "The mail server refused the e-mail to 1 person." in words
    assert words.count("e-mail refused") == 1
    assert "ada@example.org no password yet e-mail refused" in words


def test_encoding_separator_and_columns_can_be_changed(
    signed_in: SignIn, course: Course, teacher: User
) -> None:
    """Each line and column is shown as it will be stored, before anything is stored."""
    client, address = signed_in(teacher), "/courses/hri-2026/enrol/"
    lines = "Gruppe|Sukunimi|Etunimi|Osoite\nA, 1|Čapek|Zoé|z@example.org\nA, 1|Müller|Jörg|j@example.org"
    file = SimpleUploadedFile("class.csv", lines.encode("cp1257"))
    preview = client.post(address, {"file": file})
    assert "The file does not say its encoding." in shown(preview)
    assert [row.name for row in preview.context["rows"]] == ["Zoé Èapek", "Jörg Müller"]
    assert [row.cells[0] for row in preview.context["rows"]] == ["A, 1", "A, 1"]
    assert "Left out: Gruppe." in shown(preview)
    again = client.post(address, {**form_of(preview), "encoding": "cp1257", "again": "1"})
    assert [row.name for row in again.context["rows"]] == ["Zoé Čapek", "Jörg Müller"]
    assert not User.objects.filter(email="z@example.org").exists()
    chosen = {**form_of(again), "column": ["unused", "first", "last", "email"]}
    changed = client.post(address, chosen)  # the list is another one: it is shown first
    assert [row.name for row in changed.context["rows"]] == ["Čapek Zoé", "Müller Jörg"]
    as_table = client.post(address, {**form_of(changed), "separator": ",", "again": "1"})
    assert all("is no e-mail address" in row.fault for row in as_table.context["rows"])
    wrong = client.post(address, {**form_of(again), "encoding": "shift_jis"})
    assert "The file is not in Shift JIS (Japanese)" in shown(wrong)
    assert client.post(address, form_of(again)).status_code == 302
    assert User.objects.get(email="z@example.org").full_name == "Zoé Čapek"


def test_titles_are_read_again_in_another_encoding(signed_in: SignIn, course: Course, teacher: User) -> None:
    client, address = signed_in(teacher), "/courses/hri-2026/enrol/"
    content = "Фамилия;Имя;Почта\nИванов;Пётр;p@example.org".encode("cp1251")  # noqa: RUF001
    preview = client.post(address, {"file": SimpleUploadedFile("class.csv", content)})
    again = client.post(address, {**form_of(preview), "encoding": "cp1251", "again": "1"})
    assert [row.name for row in again.context["rows"]] == ["Пётр Иванов"]


def test_a_spreadsheet_and_a_damaged_preview_are_refused(
    signed_in: SignIn, course: Course, teacher: User
) -> None:
    client, address = signed_in(teacher), "/courses/hri-2026/enrol/"
    for content in (
        b"PK\x03\x04 and so on",
        b"\xef\xbb\xbf\n<HTML><table>",
        b"\xd0\xcf\x11\xe0\xa1\xb1",
        b"{\\rtf1",
    ):
        book = SimpleUploadedFile("class.csv", content)
        assert "This is no CSV file" in shown(client.post(address, {"file": book}))
    for damaged in ("not base64!", "é", "AAA"):
        assert "choose it again" in shown(client.post(address, {"content": damaged}))
    assert client.post(address, {"people": "a@example.org", "column": ["emperor"]}).status_code == 400


def test_a_supervisor_does_not_learn_who_has_an_account(
    signed_in: SignIn, course: Course, teacher: User, student: User, stranger: User, staff: User
) -> None:
    for person in (student, stranger):
        person.email = f"{person.username}@example.org"
        person.save()
    open_account = User.objects.create_user("open", email="open@example.org", full_name="Secret Name")
    User.objects.filter(pk=stranger.pk).update(is_active=False)
    theirs = Course.objects.create(
        name="Theirs", slug="theirs", starts_on=course.starts_on, ends_on=course.ends_on
    )
    theirs.supervisors.add(teacher)
    client = signed_in(teacher)

    def answers(address: str) -> str:
        """Return the texts of preview and message, without the typed list."""
        posted = {"people": f"Typed <{address}>"}
        preview = client.post("/courses/hri-2026/enrol/", posted)
        done = client.post("/courses/hri-2026/enrol/", {**posted, "seen": seen_in(preview)}, follow=True)
        [message] = done.context["messages"]
        Enrolment.objects.filter(course=course).exclude(person=student).delete()
        return (shown(preview) + str(message)).replace(address, "ADDRESS")

    def preview(line: str) -> str:
        page = shown(client.post("/courses/hri-2026/enrol/", {"people": line}))
        return re.sub(r"(nobody|open|stranger)@", "", page)

    new, known, closed = (answers(f"{name}@example.org") for name in ("new", "open", "stranger"))
    assert new == known == closed
    refused = [preview(f"the console <{name}@example.org>") for name in ("nobody", "open", "stranger")]
    assert refused[0] == refused[1] == refused[2]
    assert "a meaning of its own" in refused[0]
    assert "1 person will be enrolled" in new
    assert "1 person is enrolled in HRI 2026; each person without an account got one, and an e-mail." in new
    assert User.objects.filter(email="new@example.org").exists()
    Enrolment.objects.create(course=theirs, person=open_account)  # now in another course of the teacher
    assert "Secret Name" in answers("open@example.org")
    preview = signed_in(staff).post("/courses/hri-2026/enrol/", {"people": "T <stranger@example.org>"})
    assert "This account is closed." in shown(preview)


@pytest.mark.timeout(600)  # 40 s of computing: on a full machine more than the usual 240 s
def test_5000_lines_are_enrolled_and_a_longer_file_is_refused(
    signed_in: SignIn, course: Course, teacher: User
) -> None:
    """The page's second request sends the whole list again, and must pass the limits on forms, too."""
    client, address = signed_in(teacher), "/courses/hri-2026/enrol/"
    lines = [
        f"{number};Jürgen {'Müller-Lüdenscheidt ' * 5}{number};s{number}@example.org"
        for number in range(5000)
    ]

    def sent(lines: list[str]) -> Any:
        content = "\r\n".join(["Nr;Name;E-Mail", *lines]).encode("latin-1")
        return client.post(address, {"file": SimpleUploadedFile("class.csv", content)})

    assert "at most 5000 are read. Divide it." in shown(sent([*lines, "1;a;a@example.org"]))
    assert "larger than 1.5 MB" in shown(sent([line + "x" * 400 for line in lines]))
    preview = sent(lines)
    assert "5000 people will be enrolled" in shown(preview)
    done = client.post(address, form_of(preview))
    assert done.status_code == 302
    assert Enrolment.objects.count() == 5001
    assert User.objects.get(email="s4999@example.org").full_name.endswith("4999")


def test_a_supervisor_grants_the_courses_qualifications_only(
    signed_in: SignIn, course: Course, teacher: User, student: User, robot: Robot, other_robot: Robot
) -> None:
    induction = Qualification.objects.create(name="safety induction", slug="induction")
    induction.robots.add(robot)
    foreign = Qualification.objects.create(name="arm", slug="arm")
    foreign.robots.add(other_robot)
    client = signed_in(teacher)
    until = lab_date() + timedelta(days=30)
    form = {"person": [str(student.pk)], "until": until.isoformat()}
    for qualification in ("induction", "arm"):
        client.post("/courses/hri-2026/people/", {**form, "qualification": qualification, "action": "grant"})
    [grant] = QualificationGrant.objects.all()
    assert (grant.qualification, grant.granted_by) == (induction, teacher)
    assert lab_date(grant.expires_at) == until + timedelta(days=1)
    assert missing_qualifications(student, robot, timezone.now()) == []
    last_day = f"safety induction until {until.day} {until:%b %Y}"
    assert last_day in " ".join(shown(client.get("/courses/hri-2026/")).split())
    form = {"everybody": "on", "qualification": "induction", "action": "revoke"}
    client.post("/courses/hri-2026/people/", form)
    assert not QualificationGrant.objects.exists()


def test_a_supervisor_who_is_not_enrolled_gets_a_qualification_only(
    signed_in: SignIn, course: Course, teacher: User, student: User, robot: Robot
) -> None:
    induction = Qualification.objects.create(name="safety induction", slug="induction")
    induction.robots.add(robot)
    client = signed_in(teacher)
    assert "Tea Cher supervisor, not enrolled" in shown(client.get("/courses/hri-2026/"))
    chosen = {"person": [str(teacher.pk)], "qualification": "induction"}
    client.post("/courses/hri-2026/people/", {**chosen, "action": "grant"})
    assert missing_qualifications(teacher, robot, timezone.now()) == []
    assert shown(client.get("/courses/hri-2026/")).count("✓ safety induction") == 1
    client.post("/courses/hri-2026/people/", {**chosen, "action": "unenrol"})
    assert list(User.objects.filter(enrolments__course=course)) == [student]
    client.post("/courses/hri-2026/people/", {**chosen, "action": "revoke"})
    assert not QualificationGrant.objects.exists()


def test_nobody_outside_the_course_can_be_chosen(
    signed_in: SignIn, course: Course, teacher: User, student: User, stranger: User, robot: Robot
) -> None:
    induction = Qualification.objects.create(name="safety induction", slug="induction")
    induction.robots.add(robot)
    form = {"person": [str(stranger.pk)], "qualification": "induction", "action": "grant"}
    signed_in(teacher).post("/courses/hri-2026/people/", form)
    assert not QualificationGrant.objects.exists()


def test_people_are_taken_out(signed_in: SignIn, course: Course, teacher: User, student: User) -> None:
    client = signed_in(teacher)
    assert "Choose people first." in shown(
        client.post("/courses/hri-2026/people/", {"action": "unenrol"}, follow=True)
    )
    client.post("/courses/hri-2026/people/", {"action": "unenrol", "person": [str(student.pk)]})
    assert not Enrolment.objects.exists()


def test_a_supervisor_cancels_a_booking_of_the_course(
    signed_in: SignIn, course: Course, teacher: User, student: User, robot: Robot
) -> None:
    starts = (timezone.now() + timedelta(days=1)).replace(second=0, microsecond=0)
    form = {"robot": robot.slug, "starts_at": f"{starts:%Y-%m-%dT%H:%M}"}
    form["ends_at"] = f"{starts + timedelta(hours=1):%Y-%m-%dT%H:%M}"
    assert signed_in(student).post("/bookings/new/", form).status_code == 200
    client = signed_in(teacher)
    page = client.get("/bookings/courses/hri-2026/")
    assert "Stu Dent" in shown(page)
    address = re.search(r'action="(/bookings/[0-9a-f-]{36}/)"', page.content.decode())[1]
    client.post(address, {"action": "cancel", "version": "1"})
    assert "The course has no bookings to come." in shown(client.get("/bookings/courses/hri-2026/"))
    assert signed_in(student).get("/bookings/courses/hri-2026/").status_code == 404


# --- joining --------------------------------------------------------------------------------------


@pytest.fixture
def invitation(course: Course, teacher: User) -> Invitation:
    expires = timezone.now() + timedelta(days=1)
    return invitation_make(course=course, expires_at=expires, most_uses=2, actor=teacher)


def test_an_invitation_is_shown_as_link_and_picture(signed_in: SignIn, course: Course, teacher: User) -> None:
    client = signed_in(teacher)
    form = {"last_day": (lab_date() + timedelta(days=7)).isoformat(), "most_uses": "40"}
    page = client.post("/courses/hri-2026/invitations/", form, follow=True)
    link = re.search(r"http://testserver/join/[^<]+", page.content.decode())[0]
    assert client.get(link.removeprefix("http://testserver")).status_code == 200
    picture = client.get(re.search(r'src="(/courses[^"]+qr\.svg)"', page.content.decode())[1])
    assert picture["Content-Type"] == "image/svg+xml"
    client.post(page.redirect_chain[-1][0] + "revoke/")
    assert client.get(link.removeprefix("http://testserver")).status_code == 410


def test_a_person_with_an_account_joins(
    signed_in: SignIn, invitation: Invitation, stranger: User, robot: Robot
) -> None:
    client = signed_in(stranger)
    page = client.post(f"/join/{invitation.code}/", follow=True)
    assert role_on(stranger, robot) is Role.OPERATOR
    assert "operator by course HRI 2026, until" in shown(page)
    group = RobotGroup.objects.create(name="Laboratorio 3", slug="lab-3")
    group.robots.add(robot)
    GroupRole.objects.create(group=group, user=stranger, role="observer")
    assert "observer by robot group Laboratorio 3, given by staff" in shown(client.get("/access/"))


def test_a_newcomer_makes_an_account_and_joins(invitation: Invitation, robot: Robot) -> None:
    client = Client()
    address = f"/join/{invitation.code}/"
    form = {"full_name": "New Comer", "username": "newcomer", "password1": PASSWORD, "password2": PASSWORD}
    wrong = client.post(address, {**form, "password2": "another"})
    assert wrong.status_code == 400
    assert not User.objects.filter(username="newcomer").exists()
    assert client.post(address, form).url == "/"
    person = User.objects.get(username="newcomer")
    assert role_on(person, robot) is Role.OPERATOR
    assert Record.objects.get(kind="account.create", parameters__user=str(person.pk)).actor_id == str(
        person.pk
    )
    assert Client().post(address, {**form, "username": "NewComer"}).status_code == 400


def test_an_account_from_a_list_gets_its_password_by_the_link(db: None) -> None:
    person = User(username="ada@example.org", email="ada@example.org")
    person.set_unusable_password()
    person.save()
    client, address = Client(), f"/welcome/{codes_of([person])[person.pk]}/"
    assert client.post(address, {"new_password1": "1", "new_password2": "1"}).status_code == 400
    form = {"new_password1": PASSWORD, "new_password2": PASSWORD}
    assert client.post(address, form).url == "/"
    assert client.login(username="ada@example.org", password=PASSWORD)
    assert client.get(address).status_code == 410


# --- groups, qualifications, why ------------------------------------------------------------------


def test_staff_make_change_and_delete_groups_and_qualifications(
    signed_in: SignIn, staff: User, robot: Robot
) -> None:
    client = signed_in(staff)
    client.post("/robot-groups/", {"new-name": "The TIAGos", "new-robots": [str(robot.pk)]})
    group = RobotGroup.objects.get(slug="the-tiagos", robots=robot)
    client.post("/qualifications/", {"new-name": "Induction", "new-groups": [str(group.pk)]})
    assert Qualification.objects.get(slug="induction", groups=group)
    assert "The TIAGos" in shown(client.get("/qualifications/"))
    client.post("/robot-groups/", {"entry": "the-tiagos", "the-tiagos-name": "All", "the-tiagos-robots": []})
    assert RobotGroup.objects.filter(name="All", robots=None).exists()
    assert client.post("/robot-groups/", {"new-name": "All"}).status_code == 400
    client.post("/qualifications/", {"entry": "induction", "action": "delete"})
    client.post("/robot-groups/", {"entry": "the-tiagos", "action": "delete"})
    kinds = Record.objects.filter(kind__regex="^(group|qualification)").order_by("id")
    assert list(kinds.values_list("kind", flat=True)) == [
        "group.create",
        "qualification.create",
        "group.change",
        "qualification.delete",
        "group.delete",
    ]


def test_a_person_sees_what_is_missing(
    signed_in: SignIn, course: Course, student: User, robot: Robot
) -> None:
    induction = Qualification.objects.create(
        name="safety induction", slug="induction", description="Every Monday."
    )
    induction.robots.add(robot)
    words = shown(signed_in(student).get("/access/"))
    assert "missing: safety induction (Every Monday.)" in words
