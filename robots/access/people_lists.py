"""Reads lists of people, as text or as CSV: each line has a name and an e-mail address. Pure."""

from __future__ import annotations

import csv
import io
import re
import unicodedata

from django.core.exceptions import ValidationError
from django.core.validators import validate_email
from django.utils.translation import gettext as _
from msgspec import Struct

MOST_LINES = 5000
NAME_LENGTH = 150  # characters, as `User.full_name`
ADDRESS_LENGTH = 254
# Titles of columns of European learning platforms, in small letters and without accents.
NAMES = {"name", "full name", "fullname", "student", "person", "vollstandiger name", "nombre completo"}
NAMES |= {"nom complet", "nombre y apellidos", "nom i cognoms", "nome completo", "nom et prenom"}
FIRST_NAMES = {
    "first name",
    "firstname",
    "given name",
    "vorname",
    "forename",
    "nombre",
    "nom",
    "nome",
    "prenom",
}
LAST_NAMES = {
    "last name",
    "lastname",
    "surname",
    "family name",
    "nachname",
    "apellido",
    "apellidos",
    "cognom",
}
LAST_NAMES |= {"apellido(s)", "cognoms", "cognom(s)", "cognome", "nom de famille", "sobrenome", "apelido"}
ADDRESSES = {
    "email",
    "e-mail",
    "mail",
    "email address",
    "e-mail address",
    "e-mail-adresse",
    "correo",
    "correu",
}
ADDRESSES |= {"correo electronico", "direccion de correo", "direccion de correo electronico", "courriel"}
ADDRESSES |= {"correu electronic", "adreca electronica", "adreca de correu", "adresse de courriel"}
ADDRESSES |= {"adresse e-mail", "adresse email", "indirizzo email", "indirizzo e-mail", "endereco de e-mail"}
IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*<(?P<email>[^<>]*)>\s*$")


class Listed(Struct, frozen=True):
    """A person of a list."""

    line: int
    name: str
    email: str


class Wrong(Struct, frozen=True):
    """A line that cannot be used, and why."""

    line: int
    text: str
    reason: str


class PeopleList(Struct, frozen=True):
    """The content of a list: people, lines that cannot be used, and notes on parts that were left out."""

    people: tuple[Listed, ...] = ()
    wrong: tuple[Wrong, ...] = ()
    notes: tuple[str, ...] = ()

    def as_text(self) -> str:
        """Return the people as a text from which `read_people` reads the same people."""
        text = io.StringIO()
        rows = csv.writer(text, delimiter=";", lineterminator="\n")
        rows.writerows([("Name", "E-mail"), *((one.name, one.email) for one in self.people)])
        return text.getvalue()


def decoded(content: bytes) -> str:
    """Return the text of a file in UTF-8, with or without a byte order mark; if it is not UTF-8, in Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def read_people(text: str) -> PeopleList:
    """Read lines such as `Ada Lovelace <ada@example.org>`, `Ada Lovelace, ada@example.org` or an address alone.

    In a CSV with a header, columns are found by their titles; columns with other titles are left out, with a note.
    """
    lines = text.removeprefix("\ufeff").splitlines()
    if len(lines) > MOST_LINES + 1:
        reason = _("The list has %(lines)d lines; at most %(most)d are read. Divide it.")
        return PeopleList(
            wrong=(Wrong(MOST_LINES + 2, "", reason % {"lines": len(lines), "most": MOST_LINES}),)
        )
    usual = _delimiter(lines)
    rows = [
        (number, line, _cells(line, usual if usual in line else _delimiter([line])))
        for number, line in enumerate(lines, start=1)
    ]
    rows = [row for row in rows if any(row[2])]
    columns, notes = _header(rows[0][2]) if rows else (None, ())
    if columns is None and _is_foreign_header(rows):
        notes = (
            _("Line %(line)d is no person but a header: %(text)s")
            % {"line": rows[0][0], "text": rows[0][1][:100]},
        )
        rows = rows[1:]
    people: list[Listed] = []
    wrong: list[Wrong] = []
    seen: dict[str, int] = {}
    repeated = 0
    for number, line, cells in rows[1:] if columns else rows:
        name, email = _by_columns(cells, columns) if columns else _by_looks(cells)
        if reason := _fault(name, email):
            wrong.append(Wrong(number, line[:100], reason))
        elif seen.setdefault(email.lower(), number) != number:
            repeated += 1
        else:
            people.append(Listed(number, name, email))
    if repeated:
        notes = (*notes, _("%(number)d repeated addresses count once.") % {"number": repeated})
    return PeopleList(tuple(people), tuple(wrong), notes)


def _is_foreign_header(rows: list[tuple[int, str, list[str]]]) -> bool:
    """Return whether the first line is a header with titles that are not known here."""
    addresses = [sum("@" in cell for cell in cells) for _number, _line, cells in rows[:2]]
    return addresses == [0, 1] and len(rows[0][2]) == len(rows[1][2]) > 1


def _plain(title: str) -> str:
    """Return a title in small letters without accents."""
    letters = unicodedata.normalize("NFKD", title.lower().strip())
    return "".join(letter for letter in letters if not unicodedata.combining(letter))


def _delimiter(lines: list[str]) -> str:
    first = next((line for line in lines if line.strip()), "")
    return max(",;\t", key=first.count)


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        row = [line]
    return [" ".join(cell.split()) for cell in row]


class _Columns(Struct, frozen=True):
    email: int
    names: tuple[int, ...]


def _header(cells: list[str]) -> tuple[_Columns | None, tuple[str, ...]]:
    """Return the columns that the first line names, and a note on the others; None if it is no header."""
    titles = [_plain(cell) for cell in cells]
    email = next((place for place, title in enumerate(titles) if title in ADDRESSES), None)
    if email is None:
        return None, ()
    whole = [place for place, title in enumerate(titles) if title in NAMES]
    first = [place for place, title in enumerate(titles) if title in FIRST_NAMES]
    last = [place for place, title in enumerate(titles) if title in LAST_NAMES]
    if "prenom" in titles and not last:  # then "nom" is French, and the last name
        first.sort(key=lambda place: titles[place] != "prenom")
        last = first[1:]
    names = tuple(whole[:1] or [*first[:1], *last[:1]])
    others = [cell for place, cell in enumerate(cells) if place not in (email, *names) and cell]
    note = _("Left out: %(columns)s.") % {"columns": ", ".join(others)[:300]}
    return _Columns(email, names), (note,) if others else ()


def _by_columns(cells: list[str], columns: _Columns) -> tuple[str, str]:
    def cell(place: int) -> str:
        return cells[place] if place < len(cells) else ""

    return " ".join(filter(None, map(cell, columns.names))), cell(columns.email)


def _by_looks(cells: list[str]) -> tuple[str, str]:
    """Return name and address of a line of a list without header: the cell with @ is the address."""
    place = next((place for place, cell in enumerate(cells) if "@" in cell), None)
    if place is None:
        return " ".join(cells), ""
    found = IN_BRACKETS.match(cells[place])
    before = next((cell for cell in cells[:place] if cell), "")
    if found is None:
        after = next((cell for cell in cells[place + 1 :] if cell), "")
        return before or after, cells[place]
    # "Lovelace, Ada <ada@example.org>"
    return f"{found['name']} {before}".strip().strip('"'), found["email"].strip()


def _fault(name: str, email: str) -> str:
    """Return why a line cannot be used; "" if it can."""
    if "\0" in name + email:
        return _("It contains a character that is no text. Save the file as CSV.")
    if not email:
        return _("There is no e-mail address.")
    try:
        validate_email(email)
    except ValidationError:
        return _("%(address)s is no e-mail address.") % {"address": email[:60]}
    if len(email) > ADDRESS_LENGTH or len(name) > NAME_LENGTH:
        return _("The name or the address is too long.")
    return ""
