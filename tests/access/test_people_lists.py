"""Lists of people as teachers have them: pasted, from a spreadsheet, from a learning platform."""

from __future__ import annotations

import io
import zipfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.access.people_lists.columns import Role
from robots.access.people_lists.encodings import ENCODINGS, NotInEncodingError, decoded
from robots.access.people_lists.reading import MOST_LINES, read_people
from robots.access.people_lists.workbooks import NoWorkbookError, read_workbook

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
        "Etunimi;Sukunimi;Sähköposti",
        "Imię;Nazwisko;Adres e-mail (uczelnia)*",
        "Ad;Soyad;E-posta",
        "Имя;Фамилия;Электронная почта",
        "Nombre;Primer apellido;Correo electrónico",
        "First name;Unknown title;Email",
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
    assert found.notes == ("Name from: Nimi. E-mail address from: Sähköposti.",)
    foreign = read_people("Foo;Bar;Baz\nAda;Lovelace;ada@example.org")
    assert "First and last name are guessed: check their order." in foreign.notes
    assert [(one.name, one.email) for one in foreign.people] == [ADA]


def test_each_line_may_have_its_own_separator() -> None:
    assert people("Ada Lovelace, ada@example.org\nBo Ek\tbo@example.org") == [
        ADA,
        ("Bo Ek", "bo@example.org"),
    ]


def test_other_columns_are_left_out_with_a_note() -> None:
    found = read_people("Name;Matr.-Nr.;E-Mail;Mark\nAda Lovelace;12;ada@example.org;1")
    assert [(one.name, one.email) for one in found.people] == [ADA]
    assert found.notes == (
        "Name from: Name. E-mail address from: E-Mail.",
        "Student number from: Matr.-Nr.",
        "Left out: Mark.",
    )
    assert [one.number for one in found.people] == ["12"]


def test_wrong_lines_are_named_by_number_and_reason() -> None:
    found = read_people("Name,Email\nAda Lovelace,ada@example.org\n\nBob,bob(at)example\nCarl,carl@\nEve,")
    assert [(one.line, one.reason) for one in found.wrong] == [
        (4, "bob(at)example is no e-mail address."),
        (5, "carl@ is no e-mail address."),
        (6, "There is no e-mail address."),
    ]
    assert len(found.people) == 1


@pytest.mark.parametrize(
    ("encoding", "name"),
    [
        ("utf-8", "Zoé D’Arc Œuvré"),
        ("utf-8-sig", "王小明"),
        ("utf-16", "Zoé D’Arc Œuvré"),
        ("utf-32", "Zoé D’Arc Œuvré"),
        ("utf-16-le", "Zoé D’Arc Œuvré"),
        ("utf-16-be", "Zoé D’Arc Œuvré"),
        ("latin-1", "Jürgen Größe"),
        ("cp1252", "Zoé D’Arc Œuvré … Š"),
        ("cp1252", "Nicolò Cantù"),
        ("cp1252", "Bjørn Åsen"),
        ("iso8859_15", "Zoé Œuvré"),
        ("mac_roman", "Zoé D’Arc Œuvré"),
        ("cp850", "Jürgen Größe"),
        ("cp1250", "Łukasz Świątek"),
        ("cp1250", "Jiří Dvořák"),
        ("cp1254", "Çağlar Yılmaz"),  # noqa: RUF001
        ("iso8859_15", "Þórður Guðmundsson"),
        ("cp850", "Åse Møller"),
        ("mac_latin2", "Łukasz Świątek"),
        ("mac_cyrillic", "Юлия Щукина"),
        ("cp1251", "Юлия Щукина"),
        ("koi8_r", "Юлия Щукина"),
        ("cp1253", "Ελένη Παπαδάκη"),
        ("shift_jis", "鈴木 一郎"),
    ],
)
def test_the_encoding_of_a_file_is_found(encoding: str, name: str) -> None:
    read = decoded(f"Name;E-Mail\r\n{name};jg@example.org".encode(encoding))
    assert people(read.text) == [(name, "jg@example.org")]
    assert read.certain is encoding.startswith("utf")


@pytest.mark.parametrize(
    ("encoding", "header", "name"),
    [
        ("cp1254", "Adı Soyadı;E-posta", "Ayşe Işık"),  # noqa: RUF001
        ("euc_jp", "氏名;メールアドレス", "山田 花子"),
        ("gb18030", "姓名;邮箱", "王小明"),
        ("cp866", "ФИО;Почта", "Юлия Щукина"),
    ],
)
def test_titles_tell_encodings_with_the_same_letters(encoding: str, header: str, name: str) -> None:
    read = decoded(f"{header}\r\n{name};a@example.org".encode(encoding))
    assert people(read.text) == [(name, "a@example.org")]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_no_letter_is_replaced_in_any_encoding(encoding: str) -> None:
    content = bytes(range(256))
    try:
        assert decoded(content, encoding).text.encode(encoding.replace("utf-16", "utf-16-le")) == content
    except NotInEncodingError as error:
        assert "choose another encoding" in str(error)


def test_a_name_with_a_character_that_is_no_text_is_named() -> None:
    found = read_people("Name;Mail\nAda\x84;a@example.org\nBo\x8f;b@example.org\nC\ufffd;c@example.org")
    assert not found.people
    assert {one.reason for one in found.wrong} == {
        "It contains a character that is no text: choose another encoding, or save the file as CSV."
    }


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Ada;Lovelace;ada@example.org", [ADA]),  # no header
        ("Name;Vorname;E-Mail\nLovelace;Ada;ada@example.org", [ADA]),  # here "Name" is the last name
        ("sep=;\nName;Mail\nAda Lovelace;ada@example.org", [ADA]),  # Excel
        ('Name,Mail\n"Ada\nLovelace",ada@example.org', [ADA]),  # a cell of two lines
        ("Kurs 2026\n\nNachname|Vorname|Mail\nLovelace|Ada|ada@example.org", [ADA]),
        (
            'Name;Note;Mail\n"Ada\nLovelace";"a\nb";ada@example.org',
            [ADA],
        ),  # the quote comes before the separator
        ("Lovelace, Ada;ada@example.org", [ADA]),
        ("Name;Mail\nAda Lovelace;mailto:ada@example.org", [ADA]),
        ("Name;Mail\nAda Lovelace;A. L. <ada@example.org>", [ADA]),
        ("First name,E-mail - Type,E-mail - Value\nAda,* Work,ada@example.org", [("Ada", ADA[1])]),
        ("Segundo apellido;Nombre;Primer apellido;Correo\n;Ada;Lovelace;ada@example.org", [ADA]),
        ("Foo;Bar;Baz\nAda Lovelace;ada@example.org;", [ADA]),
        ("sep=^\nName;Mail\nAda Lovelace;ada@example.org", [ADA]),
        ("Ada Lovelace <ada@example.org>; Bo <b@example.org>", [ADA, ("Bo", "b@example.org")]),
        (
            "; ".join(f"A{number} <a{number}@example.org>" for number in range(150)),
            [(f"A{number}", f"a{number}@example.org") for number in range(150)],
        ),
        ("ada@example.org, b@example.org", [("", "ada@example.org"), ("", "b@example.org")]),
        (
            '"Ada,ada@example.org\nBo,b@example.org\nCy,c@example.org',
            [("Bo", "b@example.org"), ("Cy", "c@example.org")],
        ),
    ],
)
def test_no_line_and_no_name_is_lost(text: str, expected: list[tuple[str, str]]) -> None:
    found = read_people(text)
    assert [(one.name, one.email) for one in found.people] == expected
    used = {one.line for one in (*found.people, *found.wrong)}
    assert len(used) + 1 >= len([line for line in text.split("\n") if "@" in line])


@pytest.mark.parametrize(
    "text",
    [
        "Ada Lovelace, ada@example.org\nBo Ek; bo@example.org",
        "Foo;Bar;Baz\nAda;Lovelace;ada@example.org",
        "Name,E-Mail\nAda Lovelace,ada@example.org",
        "ada@example.org",
        "Ada <ada@example.org>; Bo <bo@example.org>",
        "; ".join(f"A{number} <a{number}@example.org>" for number in range(150)),
    ],
)
def test_the_preview_reads_a_list_as_before(text: str) -> None:
    """The form of the preview sends back how the list was read."""
    found = read_people(text)
    again = read_people(text, found.separator, [column.role for column in found.columns])
    assert again == found


def test_a_first_line_that_may_be_a_person_is_shown() -> None:
    guessed = read_people("Ada Lovelace;ada(at)example.org\nBo Ek;bo@example.org")
    assert [(one.line, one.reason) for one in guessed.titles] == [
        (1, "It is taken as the titles of the columns.")
    ]
    incomplete = read_people("Ada Lovelace;\nBo Ek;bo@example.org")
    assert [one.line for one in incomplete.wrong] == [1]


def test_each_line_that_is_left_out_is_named() -> None:
    wide = read_people("Name;Mail\nAda;a@example.org\n" + ";" * 200_000 + "x\n" + ";" * 200_000)
    assert [one.line for one in wide.wrong] == [3]
    assert len(wide.columns) == 2
    second = read_people("Name;Mail\nAda;a@example.org;second@example.org")
    assert "Left out: column 3." in second.notes
    found = read_people("Name,Mail\nA,a@example.org\nB,A@example.org\nA <a@x.org> B <b@x.org>,c@example.org")
    assert [(one.line, one.reason) for one in found.repeated] == [(3, "The address stands in line 2, too.")]
    assert [one.line for one in found.wrong] == [4]


def test_a_list_of_5000_lines_is_read_and_a_longer_one_refused() -> None:
    lines = [f"Student {number},s{number}@example.org" for number in range(MOST_LINES)]
    assert len(people("\n".join(["name,email", *lines]))) == MOST_LINES
    longer = read_people("\n".join([*lines, *lines]))
    assert not longer.people
    assert "10000 lines" in longer.wrong[0].reason
    heads = read_people("\n".join(["a@example.org, b@example.org"] * MOST_LINES))
    assert (len(heads.people), len(heads.repeated), heads.wrong[0].line) == (
        2,
        MOST_LINES - 2,
        MOST_LINES // 2 + 1,
    )


def test_notes_name_each_column_that_is_not_used() -> None:
    assert "Left out: Büro-Nr." in read_people("Name;Büro-Nr.;E-Mail\nAda;7;a@example.org").notes
    second = read_people("Ada,a@example.org,ada@example.net\nBob,b@example.org,")
    assert second.notes == ("Left out: column 3.",)


def test_each_address_of_a_line_of_addresses_is_in_a_used_column() -> None:
    text = "a@example.org,b@example.org"
    found = read_people(text)
    assert [column.role for column in found.columns] == [Role.EMAIL, Role.EMAIL]
    assert people(text) == [("", "a@example.org"), ("", "b@example.org")]
    chosen = read_people(text, roles=[Role.EMAIL, Role.UNUSED])
    assert [one.email for one in chosen.people] == ["a@example.org"]


# --- as registries give them ----------------------------------------------------------------------

REGISTRY = (
    "Universität Beispielstadt;;;\r\nKurs: Robotik 1, WS 2026;;;\r\n;;;\r\n"
    "Matrikel-Nr.;Nachname, Vorname;E-Mail-Adresse;Fachsemester\r\n"
    "0123456;Lovelace, Ada;Ada@example.org;3\r\n"
    "0123457;Müller, Zoë;z@example.org;3\r\n"
    "0123458;Davis, Jr.;d@example.org;3\r\n"
)


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8-sig", "utf-16", "utf-8"])
@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_registrys_list_is_read_whole(encoding: str, separator: str) -> None:
    text = REGISTRY.replace(";", separator)
    found = read_people(decoded(text.encode(encoding)).text)
    assert [(one.number, one.name, one.email) for one in found.people] == [
        ("0123456", "Ada Lovelace", "ada@example.org"),
        ("0123457", "Zoë Müller", "z@example.org"),
        ("0123458", "Davis, Jr.", "d@example.org"),
    ]
    assert not found.wrong
    assert {one.reason for one in found.titles} == {"It stands above the titles of the columns."}
    assert [column.role for column in found.columns[:3]] == [Role.NUMBER, Role.LAST_FIRST, Role.EMAIL]


@pytest.mark.parametrize(
    "header",
    [
        "Student ID;Name;Email",
        "Expediente;Apellidos y nombre;Correo electrónico",
        "NIU;Cognoms, nom;Correu electrònic",
        "N° étudiant;Nom, Prénom;Courriel",
        "Matricola;Cognome e Nome;Posta elettronica",
        "Numer albumu;Nazwisko i imię;Adres e-mail",
        "学号;姓名;电子邮件",
    ],
)
def test_numbers_and_turned_names_have_titles_in_many_languages(header: str) -> None:
    [one] = read_people(f'{header}\n7;"Lovelace, Ada";ada@example.org').people
    assert (one.number, one.name) == ("7", "Ada Lovelace")


def test_a_column_of_any_title_is_named_by_its_select() -> None:
    text = "Foo;Bar;Baz\nLovelace, Ada;ada@example.org;7\nEk, Bo;bo@example.org;8"
    roles = [Role.LAST_FIRST, Role.EMAIL, Role.NUMBER]
    found = read_people(text, ";", roles)
    assert [(one.name, one.number) for one in found.people] == [("Ada Lovelace", "7"), ("Bo Ek", "8")]
    kept = read_people(text, ";", [Role.NAME, Role.EMAIL])
    assert kept.people[0].name == "Lovelace, Ada"


def test_a_person_with_a_number_needs_no_address() -> None:
    found = read_people("Number;Student ID;Name\n1;77;Ada Lovelace\n2;78;\n3;77;Bo Ek\n4;1,2E+11;Cy Ek")
    assert [(one.number, one.email) for one in found.people] == [("77", "")]
    assert [one.reason for one in (*found.repeated, *found.wrong)] == [
        "The student number stands in line 2, too.",
        "There is no e-mail address.",
        "A spreadsheet has shortened the student number to 1,2E+11: make that column text there.",
    ]


# --- workbooks ------------------------------------------------------------------------------------


def workbook(rows: str, strings: str = "", sheets: int = 1) -> bytes:
    """Return an .xlsx file with these rows, as spreadsheet programs write it."""
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    relations = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    names = "".join(f'<sheet name="S{n}" sheetId="{n}" r:id="rId{n}"/>' for n in range(1, sheets + 1))
    parts = {
        "xl/workbook.xml": f'<workbook xmlns="{main}" xmlns:r="{relations}"><sheets>{names}</sheets></workbook>',
        "xl/_rels/workbook.xml.rels": '<Relationships xmlns="x"><Relationship Id="rId1" Target="worksheets/one.xml"/>'
        "</Relationships>",
        "xl/sharedStrings.xml": f'<sst xmlns="{main}">{strings}</sst>',
        "xl/worksheets/one.xml": f'<worksheet xmlns="{main}"><sheetData>{rows}</sheetData></worksheet>',
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, text)
    return file.getvalue()


ROWS = (
    '<row r="1"><c r="A1" t="inlineStr"><is><t>Robotics 1</t></is></c></row>'
    '<row r="3"><c r="A3" t="s"><v>0</v></c><c r="B3" t="s"><v>1</v></c><c r="C3" t="s"><v>2</v></c></row>'
    '<row r="4"><c r="A4"><v>1.23456789012E11</v></c><c r="B4" t="s"><v>3</v></c>'
    '<c r="C4" t="str"><v>ada@example.org</v></c></row>'
    '<row r="5"><c r="A5"><v>8</v></c><c r="C5" t="inlineStr"><is><t>bo@example.org</t></is></c></row>'
)
STRINGS = (
    "<si><t>Student ID</t></si><si><t>Name</t></si><si><t>E-mail</t></si>"
    "<si><r><t>Love</t></r><r><t>lace, Ada</t></r><rPh sb='0' eb='1'><t>not read</t></rPh></si>"
)


def test_a_workbook_is_read_like_a_list() -> None:
    read = read_workbook(workbook(ROWS, STRINGS, sheets=2))
    assert read.sheets == 2
    found = read_people(read.text, "\t")
    assert [(one.line, one.number, one.name, one.email) for one in found.people] == [
        (4, "123456789012", "Ada Lovelace", "ada@example.org"),
        (5, "8", "", "bo@example.org"),
    ]


@pytest.mark.parametrize(
    "content",
    [
        b"PK\x03\x04 and so on",
        workbook("<row"),
        workbook('<row r="x"/>'),
        workbook('<row r="1"><c r="A1" t="s"><v>7</v></c></row>'),
        workbook("", sheets=0),
    ],
)
def test_what_is_no_workbook_is_refused(content: bytes) -> None:
    with pytest.raises(NoWorkbookError):
        read_workbook(content)


def test_a_workbook_cannot_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    far = workbook(
        '<row r="1"><c r="ZZZZZZ1"><v>1</v></c><c r="A1"><v>1E999999</v></c></row><row r="9999999"/>'
    )
    assert len(read_workbook(far).text) < 100_000
    monkeypatch.setattr("robots.access.people_lists.workbooks.MOST_BYTES", 1000)
    with pytest.raises(NoWorkbookError):
        read_workbook(workbook(" " * 2000))


@given(st.text(max_size=300))
def test_any_text_is_read_without_a_fault(text: str) -> None:
    found = read_people(text)
    lines = [one.line for one in (*found.people, *found.wrong)]
    assert len(lines) == len(set(lines))
