"""Finds the columns of a list: by their titles in the languages of many learning platforms, else by their content."""

from __future__ import annotations

import enum
import re
import unicodedata
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

import yaml
from msgspec import Struct


class Role(enum.Enum):
    """The use of a column."""

    NAME = "name"
    LAST_FIRST = "last_first"  # "Lovelace, Ada" in one column
    FIRST_NAME = "first"
    LAST_NAME = "last"
    EMAIL = "email"
    NUMBER = "number"  # of a student
    UNUSED = "unused"


class Column(Struct, frozen=True):
    """A column of a list, in the order of the list. `title` is "" in a list without header."""

    title: str
    role: Role


def _plain(title: str) -> str:
    """Return a title in small letters without accents, brackets and signs: "E-Mail-Adresse (privat)*" is
    "e mail adresse".
    """
    letters = unicodedata.normalize("NFKD", re.sub(r"[(\[].*?[)\]]", " ", title.casefold()))
    letters = letters.translate({0x131: "i", 0x142: "l", 0xF8: "o"})
    kept = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return " ".join(re.sub(r"[\W_]+", " ", kept).split())


_TITLES = yaml.safe_load(Path(__file__).with_name("titles.yaml").read_text("utf-8"))
_SECOND_LAST_NAMES = {_plain(title) for title in _TITLES.pop("second last")}
_ROLES = {_plain(title): Role(role) for role, titles in _TITLES.items() for title in titles}


# Between the parts of a title such as "Nachname, Vorname" or "Apellidos y nombre"
_BETWEEN = re.compile(r"[,/&+]|\s(?:and|und|y|i|et|e|og|och|en|ja|a|ve|и)\s")
_SUFFIX = re.compile(r"(?:jr|sr|ii|iii|iv|dr|phd|ph\.d|md|msc|bsc|mba)\.?", re.IGNORECASE)


def role_of(title: str) -> Role:
    """Return the role that a title names."""
    plain = _plain(title)
    parts = [_ROLES.get(_plain(part)) for part in _BETWEEN.split(title.casefold())]
    if parts in ([Role.LAST_NAME, Role.FIRST_NAME], [Role.NAME, Role.FIRST_NAME]) or plain == "nom prenom":
        return Role.LAST_FIRST
    if plain in _SECOND_LAST_NAMES:
        return Role.LAST_NAME
    if plain in _ROLES:
        return _ROLES[plain]
    return Role.EMAIL if "@" not in title and {"mail", "email"} & set(plain.split()) else Role.UNUSED


def columns_of(header: Sequence[str], rows: Sequence[Sequence[str]]) -> tuple[Column, ...]:
    """Return the columns of a list with this header (empty: it has none) and these rows.

    A role that no title names is found by content: addresses have an @; names have letters and no digits.
    """
    width = max((len(row) for row in (header, *rows)), default=0)
    titles = [*header, *[""] * (width - len(header))]
    cells = [[cell for cell in column if cell] for column in zip_longest(*rows[:200], fillvalue="")]
    cells += [[] for _ in range(width - len(cells))]
    plain = [_plain(title) for title in titles]
    addresses = [sum("@" in cell for cell in column) for column in cells]
    roles = _one_address([role_of(title) for title in titles], addresses)
    roles = _once(_last_names(plain, roles), [title in _SECOND_LAST_NAMES for title in plain])
    if Role.EMAIL not in roles and any(addresses):
        roles[addresses.index(max(addresses))] = Role.EMAIL
    if not header:
        _more_addresses(roles, rows)
    unknown = [role_of(title) is Role.UNUSED for title in titles]
    _find_names(roles, [free and _are_names(column) for free, column in zip(unknown, cells, strict=True)])
    turned = [role is Role.NAME and _are_turned(column) for role, column in zip(roles, cells, strict=True)]
    roles = [Role.LAST_FIRST if turns else role for role, turns in zip(roles, turned, strict=True)]
    return tuple(Column(title, role) for title, role in zip(titles, roles, strict=True))


def _last_names(titles: list[str], roles: list[Role]) -> list[Role]:
    """Return the roles, with the last name for a general title beside a first name: "Name; Vorname", "Nom; Prénom".

    "Nom" alone is the first name in Catalan, which has "Cognoms" for the last.
    """
    first = [
        place
        for place, role in enumerate(roles)
        if role is Role.FIRST_NAME and (titles[place] != "nom" or "prenom" not in titles)
    ]
    if not first or Role.LAST_NAME in roles:
        return roles
    general = {Role.NAME, Role.FIRST_NAME}
    return [
        Role.LAST_NAME if role in general and place not in first else role for place, role in enumerate(roles)
    ]


def _one_address(roles: list[Role], addresses: list[int]) -> list[Role]:
    """Return the roles with one column of addresses, the one with most: "E-mail type; E-mail value" has two titles."""
    titled = [place for place, role in enumerate(roles) if role is Role.EMAIL]
    best = max(titled, key=lambda place: addresses[place], default=None)
    return [Role.UNUSED if role is Role.EMAIL and place != best else role for place, role in enumerate(roles)]


def _more_addresses(roles: list[Role], rows: Sequence[Sequence[str]]) -> None:
    """Make further columns addresses if a row has nothing but addresses, as in a letter's head."""
    for row in rows:
        filled = [place for place, cell in enumerate(row) if cell]
        if len(filled) > 1 and all("@" in row[place] for place in filled):
            for place in filled:
                roles[place] = Role.EMAIL if roles[place] is Role.UNUSED else roles[place]


def _once(roles: list[Role], repeated: list[bool]) -> list[Role]:
    """Return the roles, each at most once unless it is one to be repeated, as the second of two last names.

    First and last name make the whole name unnecessary.
    """
    parts = {Role.FIRST_NAME, Role.LAST_NAME} <= set(roles)
    once: list[Role] = []
    first: set[Role] = set()
    for role, again in zip(roles, repeated, strict=True):
        whole = role in {Role.NAME, Role.LAST_FIRST}
        unnecessary = not again and (role in first or (whole and parts))
        once.append(Role.UNUSED if unnecessary else role)
        if not again:
            first.add(role)
    return once


def _find_names(roles: list[Role], are_names: list[bool]) -> None:
    """Give columns without a known title the roles of a name that are missing."""
    free = [place for place, role in enumerate(roles) if role is Role.UNUSED and are_names[place]]
    if {Role.NAME, Role.LAST_FIRST} & set(roles) or {Role.FIRST_NAME, Role.LAST_NAME} <= set(roles):
        return
    for known, other in ((Role.FIRST_NAME, Role.LAST_NAME), (Role.LAST_NAME, Role.FIRST_NAME)):
        if known in roles:
            beside = [place for place in free if abs(place - roles.index(known)) == 1]
            for place in beside[:1]:
                roles[place] = other
            return
    if len(free) == 1:
        roles[free[0]] = Role.NAME
    for place, role in zip(
        free[:2] if len(free) > 1 else (), (Role.FIRST_NAME, Role.LAST_NAME), strict=False
    ):
        roles[place] = role


def _are_names(cells: Sequence[str]) -> bool:
    """Return whether most of these cells could be parts of names."""
    names = sum(
        any(map(str.isalpha, cell)) and not any(map(str.isdigit, cell)) and "@" not in cell for cell in cells
    )
    return names > 0 and 2 * names > len(cells)


def name_in_order(cell: str) -> str:
    """Return "Ada Lovelace" for "Lovelace, Ada"; another name as it is, also "Sammy Davis, Jr."."""
    last, comma, first = (part.strip() for part in cell.partition(","))
    if not (comma and last and first) or "," in first or _SUFFIX.fullmatch(first):
        return cell
    return f"{first} {last}"


def _are_turned(cells: Sequence[str]) -> bool:
    """Return whether most of these names have the last name first, before a comma."""
    return 2 * sum(name_in_order(cell) != cell for cell in cells) > len(cells) > 0
