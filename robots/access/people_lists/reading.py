"""Reads lists of people: each line has a name and an e-mail address, in columns or as in a letter's address.

A line may have a student number, too; with a name and a number it needs no address.
"""

from __future__ import annotations

import csv
import re
import unicodedata
from codecs import BOM_UTF8
from collections.abc import Iterable, Sequence
from itertools import chain, repeat

from django.core.exceptions import ValidationError
from django.core.validators import validate_email
from django.utils.translation import gettext as _
from django.utils.translation import ngettext
from msgspec import Struct, structs

from fleet.base.names import spelled_out
from robots.access.people_lists.columns import Column, Role, columns_of, name_in_order, role_of

MOST_LINES = 5000
MOST_COLUMNS = 100
NAME_LENGTH = 150  # characters, as `User.full_name`
ADDRESS_LENGTH = 254
NUMBER_LENGTH = 40
SHORTENED = re.compile(r"\d[.,]\d+E\+\d+", re.IGNORECASE)  # "1,23E+11": digits are lost
SEPARATORS = ",;\t|"
LINES_OF_CELL = 5  # a cell in quotes may go on in the next lines; a forgotten quote must not swallow the list
HEADER_WITHIN = 10  # lines: some exports begin with the name of the course

MOST_JUDGED = 2000  # characters of a line that tell the separator
ADDRESS = re.compile(r"^(.*<)?[^\s@<>;,|]+@[^\s@<>;,|]+>?$")
IN_BRACKETS = re.compile(r"^(?P<name>.*?)\s*<(?P<email>[^<>]*)>\s*$")
# `splitlines` also splits at characters that stand in names of broken files
LINE_ENDS = re.compile(r"\r\n|\r|\n")


class Listed(Struct, frozen=True):
    """A person of a list."""

    line: int
    name: str
    email: str  # in small letters; "": the line has a number only
    cells: tuple[str, ...] = ()  # the line as it was read
    number: str = ""  # of the student

    @property
    def key(self) -> str:
        """Return what tells this person from the others of the list."""
        return self.email or self.number


class Wrong(Struct, frozen=True):
    """A line that cannot be used, and why."""

    line: int
    text: str
    reason: str
    cells: tuple[str, ...] = ()


class PeopleList(Struct, frozen=True):
    """The content of a list: people, lines that cannot be used, and notes on parts that were left out."""

    people: tuple[Listed, ...] = ()
    wrong: tuple[Wrong, ...] = ()
    notes: tuple[str, ...] = ()
    repeated: tuple[Wrong, ...] = ()  # lines with an address of an earlier line
    # Lines above the header, and the header, if nothing but its place says that it is one
    titles: tuple[Wrong, ...] = ()
    columns: tuple[Column, ...] = ()
    separator: str = ""  # "": the list has one column

    @property
    def is_empty(self) -> bool:
        """Return whether no line has a person, or was to have one."""
        return not self.people and not self.wrong


class _Line(Struct, frozen=True):
    number: int
    text: str
    cells: tuple[str, ...]


def read_people(text: str, separator: str = "", roles: Sequence[Role] = ()) -> PeopleList:
    """Read lines such as `Ada Lovelace <ada@example.org>`, `Ada Lovelace, ada@example.org` or an address alone.

    `separator` is one of `SEPARATORS`, "" finds it. `roles` are the roles of the columns; without them, titles and
    content decide. Each line is a person, wrong, repeated, or the header.
    """
    texts = LINE_ENDS.split(text.removeprefix(BOM_UTF8.decode()))
    if len(texts) > MOST_LINES + 1 + (not texts[-1]):
        reason = _("The list has %(lines)d lines; at most %(most)d are read. Divide it.")
        return PeopleList(
            wrong=(Wrong(MOST_LINES + 2, "", reason % {"lines": len(texts), "most": MOST_LINES}),)
        )
    usual = separator or _separator(texts)
    read = _lines(texts, usual, fixed=usual != _separator(texts))
    lines = [part for line in read if line.cells for part in _parts(line)]
    wide = [line for line in lines if len(line.cells) > MOST_COLUMNS]
    above, header, lines = _without_header([line for line in lines if len(line.cells) <= MOST_COLUMNS])
    columns = columns_of(header.cells if header else (), [line.cells for line in lines])
    if roles:
        chosen = zip(columns, chain(roles, repeat(Role.UNUSED)), strict=False)
        columns = tuple(Column(column.title, role) for column, role in chosen)
    found = _people(lines, columns, usual if len(columns) > 1 else "")
    if wide:
        found = structs.replace(found, wrong=(*found.wrong, *map(_too_wide, wide)))
    if above:
        reason = _("It stands above the titles of the columns.")
        titles = tuple(Wrong(line.number, line.text[:100], reason, line.cells) for line in above)
        found = structs.replace(found, titles=titles)
    if header and all(role_of(title) is Role.UNUSED for title in header.cells):
        reason = _("It is taken as the titles of the columns.")
        guessed = Wrong(header.number, header.text[:100], reason, header.cells)
        note = _("Line %(line)d is taken as titles: %(text)s") % {
            "line": guessed.line,
            "text": spelled_out(guessed.text),
        }
        found = structs.replace(found, titles=(guessed,), notes=(note, *found.notes))
    return found


def _parts(line: _Line) -> list[_Line]:
    """Return the addresses of a letter to many people as lines of their own, another line as it is."""
    addresses = [cell for cell in line.cells if cell]
    if len(line.cells) <= MOST_COLUMNS or not all("@" in cell for cell in addresses):
        return [line]
    return [_Line(line.number, cell, (cell,)) for cell in addresses]


def _too_wide(line: _Line) -> Wrong:
    reason = _("The line has %(columns)d columns; at most %(most)d are read.")
    facts = {"columns": len(line.cells), "most": MOST_COLUMNS}
    return Wrong(line.number, line.text[:100], reason % facts, line.cells[:1])


def _people(lines: Iterable[_Line], columns: tuple[Column, ...], separator: str) -> PeopleList:
    people: list[Listed] = []
    wrong: list[Wrong] = []
    repeated: list[Wrong] = []
    seen: dict[str, int] = {}  # addresses and numbers, and their first lines
    for line in lines:
        if len(people) + len(repeated) >= MOST_LINES:  # a line may have many people
            reason = _("At most %(most)d people are read; the list has more from this line on. Divide it.")
            wrong.append(Wrong(line.number, line.text[:100], reason % {"most": MOST_LINES}, line.cells))
            break
        for one in _persons(line, columns):
            text = line.text[:100]
            if reason := _fault(one):
                wrong.append(Wrong(line.number, text, reason, line.cells))
                break  # a line is used as a whole or not at all
            if (first := seen.setdefault(one.key, line.number)) != line.number:
                reason = (
                    _("The address stands in line %(line)d, too.")
                    if one.email
                    else _("The student number stands in line %(line)d, too.")
                )
                repeated.append(Wrong(line.number, text, reason % {"line": first}, line.cells))
            elif one.number and (first := seen.setdefault(one.number, line.number)) != line.number:
                reason = _("The student number stands in line %(line)d, too.")
                wrong.append(Wrong(line.number, text, reason % {"line": first}, line.cells))
            else:
                people.append(one)
    return PeopleList(
        people=tuple(people),
        wrong=tuple(wrong),
        notes=_notes(columns, people, repeated),
        repeated=tuple(repeated),
        columns=columns,
        separator=separator,
    )


def _notes(columns: Sequence[Column], people: Sequence[Listed], repeated: Sequence[Wrong]) -> tuple[str, ...]:
    """Return sentences about parts of the list that are not used."""
    notes = []
    if any(column.title for column in columns):

        def titles(*roles: Role) -> str:
            found = (each.title for role in roles for each in columns if each.role is role and each.title)
            return ", ".join(found) or "-"

        facts = {
            "names": titles(Role.NAME, Role.LAST_FIRST, Role.FIRST_NAME, Role.LAST_NAME),
            "email": titles(Role.EMAIL),
            "number": titles(Role.NUMBER),
        }
        notes.append(_("Name from: %(names)s. E-mail address from: %(email)s.") % facts)
        if facts["number"] != "-":
            text = _("Student number from: %(number)s.")
            notes.append(text % {"number": facts["number"].removesuffix(".")})
    unused = [
        column.title or _("column %(number)d") % {"number": number}
        for number, column in enumerate(columns, start=1)
        if column.role is Role.UNUSED and any(_is_lost(one, number - 1) for one in people)
    ]
    parts = [each for each in columns if each.role in (Role.FIRST_NAME, Role.LAST_NAME)]
    if any(role_of(each.title) is Role.UNUSED for each in parts):
        notes.append(_("First and last name are guessed: check their order."))
    if unused:
        columns_left = spelled_out(", ".join(unused)[:300])
        notes.append(_("Left out: %(columns)s.") % {"columns": columns_left.removesuffix(".")})
    if nameless := sum(not one.name for one in people):
        text = ngettext(
            "%(number)d person has no name in the list.",
            "%(number)d people have no name in the list.",
            nameless,
        )
        notes.append(text % {"number": nameless})
    if repeated:
        text = ngettext(
            "%(number)d repeated address counts once.",
            "%(number)d repeated addresses count once.",
            len(repeated),
        )
        notes.append(text % {"number": len(repeated)})
    return tuple(notes)


def _is_lost(one: Listed, place: int) -> bool:
    """Return whether this person's cell is not used, for a column without use. A line may have its own order."""
    cell = one.cells[place] if place < len(one.cells) else ""
    return bool(cell) and not (one.email and one.email in cell.lower())


# --- lines and cells ------------------------------------------------------------------------------


def _separator(texts: Sequence[str]) -> str:
    first = next((text for text in texts if text.strip()), "")
    if ">;" in first:  # addresses of a letter, in which a comma may be part of a name
        return ";"
    if first.lower() in {f"sep={mark}" for mark in SEPARATORS}:  # Excel's own way to say it
        return first[4]
    # "Lovelace, Ada;ada@example.org": the mark beside the address counts. The first line may be a title.
    samples = [first, *[text for text in texts if "@" in text][:5]]

    def fit(mark: str) -> tuple[int, int, int]:
        beside = sum(any(map(ADDRESS.match, _rough_cells(sample, mark))) for sample in samples)
        return beside, first.count(mark), sum(sample.count(mark) for sample in samples)

    return max(SEPARATORS, key=fit)


def _rough_cells(text: str, mark: str) -> list[str]:
    return [cell.strip(' "') for cell in text[:MOST_JUDGED].split(mark)]


def _lines(texts: Sequence[str], separator: str, *, fixed: bool) -> Iterable[_Line]:
    """Yield the lines with their cells. Unless the separator is fixed, a line without it may have its own."""
    at = 0
    while at < len(texts):
        number, text = at + 1, texts[at]
        inside = fixed or separator in text or text.startswith('"')
        own = separator if inside else _separator([text])
        cells, count = _cells_of(texts[at : at + LINES_OF_CELL], own)
        yield _Line(number, text, cells)
        at += count


def _cells_of(texts: Sequence[str], separator: str) -> tuple[tuple[str, ...], int]:
    """Return the cells that begin with the first of these lines, and the number of lines that they take."""
    for count in range(1, len(texts) + 1):
        try:
            return _cells("\n".join(texts[:count]), separator, strict=True), count
        except csv.Error:
            continue
    try:
        return _cells(texts[0], separator, strict=False), 1
    except csv.Error:
        return (texts[0],), 1


def _cells(text: str, separator: str, *, strict: bool) -> tuple[str, ...]:
    rows = csv.reader([text], delimiter=separator, skipinitialspace=True, strict=strict)
    cells = [" ".join(cell.split()) for cell in next(rows, [])]
    filled = [place for place, cell in enumerate(cells, start=1) if cell]
    return tuple(cells[: filled[-1]] if filled else ())  # spreadsheets end lines with empty cells


def _without_header(lines: list[_Line]) -> tuple[list[_Line], _Line | None, list[_Line]]:
    """Return the lines above the header, the header, if there is one, and the lines of people."""
    if lines and lines[0].text.lower().startswith("sep="):
        lines = lines[1:]
    for place, line in enumerate(lines[:HEADER_WITHIN]):
        if any("@" in cell for cell in line.cells):
            break
        roles = {role_of(cell) for cell in line.cells} - {Role.UNUSED}
        if Role.EMAIL in roles or len(roles) > 1:
            return lines[:place], line, lines[place + 1 :]
    if len(lines) > 1 and _is_header(lines[0], lines[1]):
        return [], lines[0], lines[1:]
    return [], None, lines


def _is_header(line: _Line, following: _Line) -> bool:
    """Return whether a line has titles that are not known here: no fewer cells than the next, and no address."""
    addresses = [any("@" in cell for cell in each.cells) for each in (line, following)]
    return addresses == [False, True] and all(line.cells) and len(line.cells) >= len(following.cells) > 1


# --- people ---------------------------------------------------------------------------------------


def _persons(line: _Line, columns: Sequence[Column]) -> list[Listed]:
    """Return each person of a line: several only in a line of addresses, as in a letter's head."""
    cells = line.cells
    filled = [cell for cell in cells if cell]
    if (
        len(filled) > 1
        and all("@" in cell for cell in filled)
        and not any(column.title for column in columns)
    ):
        pairs = zip(cells, columns, strict=False)
        found = [_as_address(cell) for cell, column in pairs if cell and column.role is not Role.UNUSED]
    elif any(IN_BRACKETS.match(cell) and "@" in cell for cell in cells):
        found = [_in_brackets(cells, columns)]
    else:
        found = [_by_columns(cells, columns)]
    number = " ".join(_cells_of_role(cells, columns, Role.NUMBER))
    return [Listed(line.number, name, email.lower(), cells, number) for name, email in found]


def _as_address(cell: str) -> tuple[str, str]:
    found = IN_BRACKETS.match(cell)
    return (name_in_order(found["name"].strip('" ')), _bare(found["email"])) if found else ("", cell)


def _bare(email: str) -> str:
    """Return an address without the `mailto:` of a link."""
    return re.sub(r"^\s*mailto:", "", email, flags=re.IGNORECASE).strip()


def _in_brackets(cells: Sequence[str], columns: Sequence[Column]) -> tuple[str, str]:
    """Return name and address of `Ada Lovelace <ada@example.org>` or `Lovelace, Ada <ada@example.org>`.

    In a list with titles, the columns of names go before the name in the address.
    """
    place = next(place for place, cell in enumerate(cells) if IN_BRACKETS.match(cell) and "@" in cell)
    name, email = _as_address(cells[place])
    if columns[place].title:
        named, _address = _by_columns(cells, columns)
        return named if columns[place].role is Role.EMAIL and named else name, email
    before = " ".join(filter(None, cells[:place]))
    return f"{name} {before}".strip(), email


def _cells_of_role(cells: Sequence[str], columns: Sequence[Column], role: Role) -> list[str]:
    pairs = zip(columns, cells, strict=False)
    return [cell for column, cell in pairs if cell and column.role is role]


def _by_columns(cells: Sequence[str], columns: Sequence[Column]) -> tuple[str, str]:
    def of(role: Role) -> list[str]:
        return _cells_of_role(cells, columns, role)

    email = _bare(" ".join(of(Role.EMAIL)))
    addresses = [cell for cell in cells if "@" in cell]
    if "@" not in email and len(addresses) == 1 and not any(column.title for column in columns):
        # An order of its own
        return " ".join(cell for cell in cells if cell and "@" not in cell), addresses[0]
    turned = [name_in_order(cell) for cell in of(Role.LAST_FIRST)]
    return " ".join(of(Role.NAME) + turned + of(Role.FIRST_NAME) + of(Role.LAST_NAME)), email


def _fault(one: Listed) -> str:
    """Return why a line cannot be used; "" if it can."""
    name, email = one.name, one.email
    if any(_is_no_text(letter) for letter in name + email + one.number):
        return _("It contains a character that is no text: choose another encoding, or save the file as CSV.")
    if len(email) > ADDRESS_LENGTH or len(name) > NAME_LENGTH:
        return _("The name or the address is too long.")
    if re.search(r"\S@\S", name):
        return _("There are two addresses: write one person in a line.")
    if len(one.number) > NUMBER_LENGTH or "@" in one.number:
        return _("%(number)s is no student number.") % {"number": spelled_out(one.number[:60])}
    if SHORTENED.fullmatch(one.number):
        text = _("A spreadsheet has shortened the student number to %(number)s: make that column text there.")
        return text % {"number": one.number}
    if not email:
        return "" if one.number and name else _("There is no e-mail address.")
    try:
        validate_email(email)
    except ValidationError:
        return _("%(address)s is no e-mail address.") % {"address": spelled_out(email[:60])}
    return ""


def _is_no_text(letter: str) -> bool:
    return letter == "\ufffd" or unicodedata.category(letter) in {"Cc", "Cn", "Co", "Cs"}
