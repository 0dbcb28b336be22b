"""Phrases: as a text file, in the registry, in the admin."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.core.files.uploadedfile import SimpleUploadedFile
from django.core.management import CommandError, call_command
from django.db import IntegrityError, transaction
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Phrase, Robot, RobotProfile
from robots.registry.phrases import MOST_PHRASES, Line, file_text, read
from robots.registry.services import entry_delete, entry_save, phrases_import
from tests.bookings.test_races import all_at_once

# 139 characters; the console adds spaces
MANY_TAGS = ",".join(chr(code) for code in range(0x4E00, 0x4E00 + 70))

# --- files ---------------------------------------------------------------------------------------


def test_a_line_is_a_language_and_a_text_or_a_text_alone() -> None:
    content = "es-ES\t¡Hola!\nGood morning.\n\n  \nAR-sa\tبخير\tgreeting, hello,greeting\n"
    assert read(content.encode(), "en-GB") == [
        Line("¡Hola!", "es-ES"),
        Line("Good morning.", "en-GB"),
        Line("بخير", "ar-SA", ("greeting", "hello")),
    ]


def test_files_of_other_systems_are_read_as_well() -> None:
    assert read(b"\xef\xbb\xbfde-DE\tGuten Tag!\r\nHello.\r\n") == [
        Line("Guten Tag!", "de-DE"),
        Line("Hello.", "en-GB"),
    ]


def test_a_repeated_phrase_is_stored_once() -> None:
    assert read(b"Hello.\nen-gb\tHello.\tgreeting\nfr-FR\tHello.\n") == [
        Line("Hello.", "en-GB"),
        Line("Hello.", "fr-FR"),
    ]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"Hello.\nGerman\tHallo.", "line 2: “German” is not a language code such as en-GB."),
        (b"Hello.\n\tHallo.", "line 2: “” is not a language code"),
        (b"de-DE\t", "line 1: The text is empty"),
        (b"Hello.\n\nBe\x07ep.", "line 3: Character 3 (U+0007) cannot be spoken"),
        (b"Hello.\n" + b"x" * 501, "line 2: The text has 501 characters; the limit is 500"),
        (b"en-GB\tHello.\tgreeting\tmore", "line 1: There are more than two tabs"),
        (b"en-GB\tHello.\t" + b"x" * 201, "line 1: The tags have 201 characters"),
        (b"en-GB\tHello.\t" + MANY_TAGS.encode(), "line 1: The tags have 208 characters"),
        (b"en-GB\tHello.\ta\x00b", "line 1: There is a line end, a control character"),
        (b"\xef\xbb\xbf\r\n \n", "There is no phrase in the file."),
        (b"Hello.\nGr\xfc\xdf Gott.", "line 2: This is not UTF-8 text"),
        (b"\xff\xfeH\x00", "line 1: This is not UTF-8 text"),
        (b"x" * 1_000_001, "The file is larger than 1000 kB"),
        (b"".join(b"%d\n" % number for number in range(MOST_PHRASES + 1)), "There are 1001 phrases"),
    ],
)
def test_a_bad_line_is_named_by_its_number(content: bytes, said: str) -> None:
    with pytest.raises(Problems) as caught:
        read(content)
    assert len(caught.value.lines) == 1
    assert caught.value.lines[0].startswith(said)


def test_the_first_ten_of_many_bad_lines_are_named() -> None:
    with pytest.raises(Problems) as caught:
        read(b"\t\n" * 3 + b"no\tway\tat\tall\n" * 12)
    assert len(caught.value.lines) == 11
    assert caught.value.lines[0].startswith("line 4:")
    assert caught.value.lines[-1] == "and 2 more."


def test_written_phrases_are_read_back_unchanged(tiago: RobotProfile) -> None:
    lines = [phrase.line for phrase in tiago.phrases.all()]
    assert len(lines) == 24
    for line_end in ("\n", "\r\n", "\r"):
        assert read(file_text(lines).replace("\n", line_end).encode()) == lines


# --- in the registry -----------------------------------------------------------------------------


def make(**fields: Any) -> Phrase:
    return Phrase(**{"text": "Hello.", "language": "en-GB", **fields})


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("fields", "field", "said"),
    [
        ({"text": " "}, "text", "text is empty"),
        ({"text": "x" * 501}, "text", "the limit is 500"),
        ({"text": "two\nlines"}, "text", "A phrase is one line"),
        ({"language": "English"}, "language", "is not a language code"),
        ({"tags": MANY_TAGS}, "__all__", "The tags have 208 characters; there is room for 200."),
        ({"tags": "a\x07b"}, "__all__", "There is a line end, a control character"),
    ],
)
def test_a_phrase_that_cannot_be_said_is_refused_at_its_field(
    robot: Robot, staff: User, fields: dict[str, Any], field: str, said: str
) -> None:
    with pytest.raises(ValidationError) as caught:
        entry_save(entry=make(robot=robot, **fields), actor=staff)
    assert said in caught.value.message_dict[field][0]


@pytest.mark.django_db
def test_a_phrase_belongs_to_a_profile_or_to_a_robot(robot: Robot, tiago: RobotProfile, staff: User) -> None:
    for owners in ({}, {"robot": robot, "profile": tiago}):
        with pytest.raises(ValidationError, match="either a profile or a robot"):
            entry_save(entry=make(**owners), actor=staff)
        with pytest.raises(IntegrityError), transaction.atomic():
            make(**owners).save()


@pytest.mark.django_db
def test_creation_change_and_deletion_are_recorded(robot: Robot, staff: User) -> None:
    phrase = make(robot=robot, language="EN-gb", tags="b,a\tb , b")
    entry_save(entry=phrase, actor=staff)
    assert (phrase.language, phrase.tags) == ("en-GB", "b, a b")
    assert str(phrase) == "en-GB: \u2068Hello.\u2069"
    assert read(file_text([phrase.line]).encode()) == [phrase.line]
    phrase.text = "Hello!"
    entry_save(entry=phrase, actor=staff)
    entry_save(entry=phrase, actor=staff)
    entry_delete(entry=phrase, actor=staff)
    made, changed, deleted = Record.objects.filter(kind__startswith="phrase.", robot_id=robot.id).order_by(
        "id"
    )
    assert (made.kind, made.details["text"]) == ("phrase.create", "Hello.")
    assert (changed.kind, changed.actor_id) == ("phrase.change", str(staff.pk))
    assert changed.details["changes"] == [{"field": "text", "from": "Hello.", "to": "Hello!"}]
    assert (deleted.kind, deleted.details["text"]) == ("phrase.delete", "Hello!")


@pytest.mark.django_db
def test_an_import_appends_missing_phrases(robot: Robot, staff: User) -> None:
    entry_save(entry=make(robot=robot, order=5, tags="kept"), actor=staff)
    lines = [Line("Good day.", "en-GB"), Line("Hello.", "en-GB"), Line("Hola.", "es-ES", ("greeting",))]
    assert phrases_import(owner=robot, lines=lines, actor=staff) == 2
    assert phrases_import(owner=robot, lines=lines, actor=staff) == 0
    assert [phrase.line for phrase in robot.phrases.all()] == [
        Line("Hello.", "en-GB", ("kept",)),
        Line("Good day.", "en-GB"),
        Line("Hola.", "es-ES", ("greeting",)),
    ]
    (record,) = Record.objects.filter(kind="phrase.import", robot_id=robot.id)
    assert [line["text"] for line in record.details["added"]] == ["Good day.", "Hola."]


@pytest.mark.django_db
def test_a_replacing_import_leaves_nothing_else_and_says_so(robot: Robot, staff: User) -> None:
    entry_save(entry=make(robot=robot), actor=staff)
    lines = [Line("Good day.", "en-GB")]
    assert phrases_import(owner=robot, lines=lines, actor=staff, replace=True) == 1
    assert [phrase.line for phrase in robot.phrases.all()] == lines
    record = Record.objects.get(kind="phrase.import", robot_id=robot.id)
    assert record.details["removed"] == [{"text": "Hello.", "language": "en-GB", "tags": []}]


# --- from the command line -----------------------------------------------------------------------


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "phrases.txt"


@pytest.mark.django_db
def test_commands_take_in_and_give_out_the_same_file(robot: Robot, file: Path) -> None:
    file.write_text("es-ES\tBuenos días.\tgreeting\nGood day.\n", encoding="utf-8")
    said = StringIO()
    call_command("import_phrases", file, robot=robot.slug, stdout=said)
    assert said.getvalue() == "TIAGo 1: 2 new phrases.\n"
    given = StringIO()
    call_command("export_phrases", robot=robot.slug, stdout=given)
    assert given.getvalue() == "es-ES\tBuenos días.\tgreeting\nen-GB\tGood day.\n"
    record = Record.objects.get(kind="phrase.import", robot_id=robot.id)
    assert record.actor_id.startswith("system:")


@pytest.mark.django_db
def test_a_file_with_a_bad_line_is_not_imported_at_all(robot: Robot, file: Path) -> None:
    file.write_text("Good day.\nnonsense\tGood day.\n")
    with pytest.raises(CommandError, match=r"Nothing was imported\.\nline 2: “nonsense” is not a language"):
        call_command("import_phrases", file, robot=robot.slug)
    assert not robot.phrases.exists()


@pytest.mark.django_db
def test_lines_without_language_use_the_robots_first_or_named(
    robot: Robot, tiago: RobotProfile, file: Path
) -> None:
    robot.overrides = {"topics": {"languages": ["ca-ES", "es-ES"]}}
    robot.save()
    file.write_text("Bon dia.\n")
    call_command("import_phrases", file, robot=robot.slug, stdout=StringIO())
    file.write_text("Buongiorno.\n")
    call_command("import_phrases", file, robot=robot.slug, language="it-IT", stdout=StringIO())
    assert list(robot.phrases.values_list("language", flat=True)) == ["ca-ES", "it-IT"]


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"robot": "nobody"}, "There is no robot nobody."),
        ({"profile": "nothing"}, "There is no robot profile nothing."),
        ({"profile": "tiago", "language": "Catalan"}, "“Catalan” is not a language code"),
        ({"profile": "tiago"}, "cannot be read: No such file or directory."),
    ],
)
def test_wrong_names_are_said_in_words(named: dict[str, str], said: str, file: Path) -> None:
    with pytest.raises(CommandError, match=said):
        call_command("import_phrases", file, **named)


# --- in the admin --------------------------------------------------------------------------------


@pytest.fixture
def admin(staff: User, signed_in: Any) -> Client:
    client: Client = signed_in(staff)
    return client


def uploaded(admin: Client, content: bytes, **fields: Any) -> Any:
    sent = {"file": SimpleUploadedFile("phrases.txt", content), **fields}
    return admin.post(reverse("admin:robots_phrase_import"), sent, follow=True)


def test_a_file_is_imported_in_the_admin(admin: Client, robot: Robot, staff: User) -> None:
    assert (
        reverse("admin:robots_phrase_import")
        in admin.get(reverse("admin:robots_phrase_changelist")).content.decode()
    )
    page = uploaded(admin, b"Bon dia.\nes-ES\tHola.\n", robot=robot.pk, language="ca-ES").content.decode()
    assert "TIAGo 1: 2 new phrases." in page
    assert list(robot.phrases.values_list("language", flat=True)) == ["ca-ES", "es-ES"]
    assert Record.objects.get(kind="phrase.import", robot_id=robot.id).actor_id == str(staff.pk)


def test_errors_of_a_file_are_shown_at_the_file(admin: Client, robot: Robot) -> None:
    page = uploaded(admin, b"Hello.\nx\ty\n", robot=robot.pk).content.decode()
    assert "line 2: “x” is not a language code" in page
    assert not robot.phrases.exists()


@pytest.mark.parametrize("both", [True, False])
def test_a_file_is_for_a_profile_or_for_a_robot(
    admin: Client, robot: Robot, tiago: RobotProfile, both: bool
) -> None:
    owners = {"robot": robot.pk, "profile": tiago.pk} if both else {}
    assert "Name either a profile or a robot." in uploaded(admin, b"Hello.\n", **owners).content.decode()
    assert not robot.phrases.exists()


def test_a_file_is_kept_when_the_form_is_refused(admin: Client, robot: Robot) -> None:
    refused = uploaded(admin, b"Hello.\n")
    assert "The file phrases.txt (7\xa0bytes) is still here." in refused.content.decode()
    form = refused.context["form"]
    kept = {name: form[name].value() for name in ("content", "file_name")}
    address = reverse("admin:robots_phrase_import")
    dropped = admin.post(address, {**kept, "without_file": "on", "robot": robot.pk})
    assert "Choose a file." in dropped.content.decode()
    assert admin.post(address, {**kept, "robot": robot.pk}).status_code == 302
    assert robot.phrases.get().text == "Hello."


def test_only_staff_imports(operator: User, signed_in: Any, robot: Robot) -> None:
    answer = uploaded(signed_in(operator), b"Hello.\n", robot=robot.pk)
    assert "/admin/login/" in answer.redirect_chain[0][0]
    assert not robot.phrases.exists()


def test_chosen_phrases_are_exported(admin: Client, tiago: RobotProfile) -> None:
    chosen = list(tiago.phrases.filter(language="ar-SA"))
    sent = {"action": "export", "_selected_action": [phrase.pk for phrase in chosen]}
    answer = admin.post(reverse("admin:robots_phrase_changelist"), sent)
    assert answer["Content-Type"] == "text/plain; charset=utf-8"
    assert read(answer.content) == [phrase.line for phrase in chosen]


def test_phrases_are_listed_and_exported_by_whose_they_are(
    admin: Client, tiago: RobotProfile, robot: Robot
) -> None:
    make(robot=robot, text="Mine.", order=0).save()
    last = tiago.phrases.last()
    assert last is not None
    page = admin.get(reverse("admin:robots_phrase_changelist")).content.decode()
    assert page.index(last.text) < page.index("Mine.")
    sent = {"action": "export", "_selected_action": list(Phrase.objects.values_list("pk", flat=True))}
    answer = admin.post(reverse("admin:robots_phrase_changelist"), sent)
    assert read(answer.content)[-1].text == "Mine."


def test_a_phrase_is_entered_reordered_and_deleted_in_the_admin(admin: Client, robot: Robot) -> None:
    sent = {"robot": robot.pk, "text": "Hello.", "language": "en-GB", "order": 3, "tags": ""}
    assert admin.post(reverse("admin:robots_phrase_add"), sent).status_code == 302
    phrase = robot.phrases.get()
    changed = {
        "form-TOTAL_FORMS": 1, "form-INITIAL_FORMS": 1, "form-0-id": phrase.pk, "form-0-order": 7, "_save": "Save",
    }  # fmt: skip
    url = f"{reverse('admin:robots_phrase_changelist')}?robot__id__exact={robot.pk}"
    assert admin.post(url, changed).status_code == 302
    assert robot.phrases.get().order == 7
    admin.post(reverse("admin:robots_phrase_delete", args=[phrase.pk]), {"post": "yes"})
    assert not robot.phrases.exists()
    kinds = Record.objects.filter(kind__startswith="phrase.", robot_id=robot.id).order_by("id")
    assert [record.kind for record in kinds] == ["phrase.create", "phrase.change", "phrase.delete"]


@pytest.mark.django_db(transaction=True)
def test_lists_saved_in_opposite_orders_wait_for_each_other(
    staff: User, robot: Robot, other_robot: Robot, signed_in: Callable[[User], Client]
) -> None:
    mine = [make(robot=one, text=f"{one.name} {place}.") for place in (1, 2) for one in (robot, other_robot)]
    for phrase in mine:
        phrase.save()
    browsers = [signed_in(staff), signed_in(staff)]
    url = reverse("admin:robots_phrase_changelist")

    def save(turn: int) -> None:
        rows = {}
        for number, phrase in enumerate(mine[:: 1 if turn % 2 else -1]):
            rows |= {f"form-{number}-id": phrase.pk, f"form-{number}-order": 10 + turn}
        sent = {"form-TOTAL_FORMS": 4, "form-INITIAL_FORMS": 4, **rows, "_save": "Save"}
        assert browsers[turn % 2].post(url, sent).status_code == 302

    assert all_at_once([partial(save, turn) for turn in range(6)]) == []
    assert (
        len(set(Phrase.objects.filter(pk__in=[one.pk for one in mine]).values_list("order", flat=True))) == 1
    )
