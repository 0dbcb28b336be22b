"""Lists of people as teachers have them: pasted, from a spreadsheet, from a learning platform."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.access.people_lists import MOST_LINES, decoded, read_people

ADA = ("Ada Lovelace", "ada@example.org")


def people(text: str) -> list[tuple[str, str]]:
    return [(one.name, one.email) for one in read_people(text).people]


@pytest.mark.parametrize(
    "text",
    [
        "Ada Lovelace <ada@example.org>",
        "Ada Lovelace, ada@example.org",
        "ada@example.org;Ada Lovelace",
        "Ada Lovelace\tada@example.org",
        '"Lovelace, Ada" <ada@example.org>',
        "Lovelace, Ada <ada@example.org>",
        "name,email\nAda Lovelace,ada@example.org",
        "E-Mail;Name\r\nada@example.org;Ada Lovelace\r\n",
        "\ufeffVorname;Nachname;E-Mail\nAda;Lovelace;ada@example.org\n\n",
        "Name,Email\nAda Lovelace,ada@example.org\nA. L.,ADA@example.org",
    ],
)
def test_lists_of_many_forms_name_the_same_person(text: str) -> None:
    [(name, email)] = people(text)
    assert (name.replace('"', ""), email) in (ADA, ("Lovelace, Ada", "ada@example.org"))


@pytest.mark.parametrize(
    "header",
    [
        "Nom;Cognoms;Adreça electrònica",
        "Nombre;Apellido(s);Dirección de correo",
        "Prénom;Nom;Adresse de courriel",
        "Nome;Cognome;Indirizzo email",
    ],
)
def test_headers_in_other_languages_are_known(header: str) -> None:
    found = read_people(f"{header}\nAda;Lovelace;ada@example.org")
    assert [(one.name, one.email) for one in found.people] == [ADA]
    assert not found.wrong
    assert people("Nom;Prénom;Courriel\nLovelace;Ada;ada@example.org") == [ADA]


def test_a_header_in_unknown_words_is_a_note_and_no_wrong_line() -> None:
    found = read_people("Nimi;Sähköposti\nAda Lovelace;ada@example.org")
    assert [(one.name, one.email) for one in found.people] == [ADA]
    assert not found.wrong
    assert found.notes == ("Line 1 is no person but a header: Nimi;Sähköposti",)


def test_each_line_may_have_its_own_separator() -> None:
    assert people("Ada Lovelace, ada@example.org\nBo Ek\tbo@example.org") == [
        ADA,
        ("Bo Ek", "bo@example.org"),
    ]


def test_other_columns_are_left_out_with_a_note() -> None:
    found = read_people("Name;Matr.-Nr.;E-Mail;Mark\nAda Lovelace;12;ada@example.org;1")
    assert [(one.name, one.email) for one in found.people] == [ADA]
    assert found.notes == ("Left out: Matr.-Nr., Mark.",)


def test_wrong_lines_are_named_by_number_and_reason() -> None:
    found = read_people("Name,Email\nAda Lovelace,ada@example.org\n\nBob,bob(at)example\nCarl,carl@\nEve,")
    assert [(one.line, one.reason) for one in found.wrong] == [
        (4, "bob(at)example is no e-mail address."),
        (5, "carl@ is no e-mail address."),
        (6, "There is no e-mail address."),
    ]
    assert len(found.people) == 1


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_a_file_may_be_utf_8_or_latin_1(encoding: str) -> None:
    text = decoded("Jürgen Größe;jg@example.org".encode(encoding))
    assert people(text) == [("Jürgen Größe", "jg@example.org")]


def test_a_list_of_5000_lines_is_read_and_a_longer_one_refused() -> None:
    lines = [f"Student {number},s{number}@example.org" for number in range(MOST_LINES)]
    assert len(people("\n".join(["name,email", *lines]))) == MOST_LINES
    longer = read_people("\n".join([*lines, *lines]))
    assert not longer.people
    assert "10000 lines" in longer.wrong[0].reason


def test_a_list_as_text_reads_back_as_the_same_people() -> None:
    found = read_people(
        "Name,Email\n\"Lovelace, Ada\",ada@example.org\nO'Neil,o'neil@example.org\n,x@example.org"
    )
    assert people(found.as_text()) == [(one.name, one.email) for one in found.people]


@given(st.text(max_size=300))
def test_any_text_is_read_without_a_fault(text: str) -> None:
    found = read_people(text)
    assert people(found.as_text()) == [(one.name, one.email) for one in found.people]
    lines = [one.line for one in (*found.people, *found.wrong)]
    assert len(lines) == len(set(lines))
