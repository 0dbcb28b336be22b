"""Names and poses of places as people enter them, and files of places. Pure.

A file is CSV in UTF-8 with the columns name, x, y (metres) and heading (radians; empty means 0).
"""

from __future__ import annotations

import csv
import io
import math
import unicodedata
from codecs import BOM_UTF8
from collections.abc import Iterable

from msgspec import Struct

from fleet.base.names import fault_of
from robots.registry.configuration.profile_schema import Problems
from robots.registry.phrases import in_line, shortened
from robots.shared.geometry.poses import Pose
from robots.shared.sentences import joined, say
from robots.shared.wire.navigation import FARTHEST_PLACE_M

LONGEST_NAME = 60  # characters
MOST_PLACES = 200  # on one map
LARGEST_FILE = 100_000  # characters
COLUMNS = ("name", "x", "y", "heading")
_SEPARATORS = ",;\t"
_MILLIMETRES = 3  # decimals
_HALF_TURN = round(math.pi, _MILLIMETRES)  # above pi: a heading of 3.142 in a file must stay unchanged


class PlaceEntry(Struct, frozen=True):
    """A place: metres and radians in the frame of the map."""

    name: str
    x: float
    y: float
    heading: float = 0.0

    @property
    def pose(self) -> Pose:
        """Return the pose of a robot at this place."""
        return Pose(self.x, self.y, self.heading)

    @property
    def key(self) -> str:
        """Return the name in the form that is compared."""
        return key_of(self.name)


def key_of(name: str) -> str:
    """Return a name in the form that is compared: without differences of case, spaces and Unicode composition."""
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())


def why_no_name(name: str) -> str | None:
    """Return why this is no name of a place or map; None if it is one."""
    if not name:
        return say("It has no name.")
    if len(name) > LONGEST_NAME:
        return say(
            "The name has {count} characters; there is room for {most}.", count=len(name), most=LONGEST_NAME
        )
    if len(key_of(name)) > 2 * LONGEST_NAME:  # normalisation may replace one letter by many
        return say("The name is too long when its letters are written out.")
    if "\ufffd" in name:
        return say("The name has a letter that was lost: type the name again.")
    if fault := fault_of(name):
        return str(fault.text)
    if not name[0].isalnum():  # a spreadsheet reads =, +, - or @ as the start of a formula
        return say("A name begins with a letter or a digit.")
    return None


def entry_of(name: str, x: float, y: float, heading: float) -> PlaceEntry:
    """Return a place: its name without repeated spaces, its pose rounded to 0.001 m and rad. Raises `Problems`."""
    name = " ".join(unicodedata.normalize("NFC", name).split(" ")).strip()
    if why := why_no_name(name):
        raise Problems([why])
    for coordinate in (x, y):
        if not abs(coordinate) <= FARTHEST_PLACE_M:
            raise Problems(
                [
                    say(
                        "{x} is not a valid coordinate: a number of metres, at most {most:.0f}.",
                        x=str(coordinate),  # JSON has no nan
                        most=FARTHEST_PLACE_M,
                    )
                ]
            )
    if not abs(heading) <= math.tau:
        raise Problems(
            [
                say(
                    "{heading} is not a valid heading: a number of radians between -6.28 and 6.28.",
                    heading=str(heading),
                )
            ]
        )
    heading = heading if abs(heading) <= _HALF_TURN else math.remainder(heading, math.tau)
    return PlaceEntry(name, *(round(part, _MILLIMETRES) for part in (x, y, heading)))


# --- files ----------------------------------------------------------------------------------------


def read(text: str) -> dict[int, PlaceEntry]:
    """Return the places of a file, by the numbers of their lines. Raises `Problems` with the numbers of wrong lines."""
    if len(text) > LARGEST_FILE:
        raise Problems([say("The file has more than {most} kB.", most=LARGEST_FILE // 1000)])
    text = text.removeprefix(BOM_UTF8.decode()).lstrip().replace("\r\n", "\n").replace("\r", "\n")
    first_line = text.split("\n", 1)[0]
    separator = next((one for one in _SEPARATORS if one in first_line), ",")
    rows = csv.reader(io.StringIO(text), delimiter=separator)
    try:
        head = next(rows, [])
    except csv.Error:
        head = []
    if tuple(map(key_of, head)) != COLUMNS:
        raise Problems(
            [in_line(1, say("The first line names the columns: {columns}", columns=",".join(COLUMNS)))]
        )
    found: dict[int, PlaceEntry] = {}
    lines: dict[str, int] = {}  # by key
    problems: list[str] = []
    try:
        for row in rows:
            if not any(map(str.strip, row)):
                continue
            try:
                entry = _entry(row)
            except Problems as faults:
                problems.append(in_line(rows.line_num, joined(" ", faults.lines)))
                continue
            found[rows.line_num] = entry
            first = lines.setdefault(entry.key, rows.line_num)
            if first != rows.line_num:
                problems.append(
                    in_line(
                        rows.line_num,
                        say("Line {first} has a place named “{name}”, too.", first=first, name=entry.name),
                    )
                )
    except csv.Error as error:
        problems.append(in_line(rows.line_num, f"{error}."))
    if not found and not problems:
        problems.append(say("There is no place in the file."))
    if len(found) > MOST_PLACES:
        problems.append(
            say("There are {count} places; a map has at most {most}.", count=len(found), most=MOST_PLACES)
        )
    if problems:
        raise Problems(shortened(problems))
    return found


def _entry(row: list[str]) -> PlaceEntry:
    if not 3 <= len(row) <= len(COLUMNS):
        raise Problems(
            [
                say(
                    "A line has {wanted} fields: {columns}; this one has {count}.",
                    wanted=len(COLUMNS),
                    columns=",".join(COLUMNS),
                    count=len(row),
                )
            ]
        )
    name, *numbers = (field.strip() for field in row)
    if "\ufffd" in name:  # a browser puts this character in place of bytes that are not UTF-8
        raise Problems(
            [say("“{name}” has a letter that is not UTF-8: save the file as CSV UTF-8.", name=name)]
        )
    try:
        x, y, heading = (float(number) if number else 0.0 for number in [*numbers, ""][:3])
    except ValueError as error:
        raise Problems(
            [say("“{numbers}” are not numbers such as 3.4.", numbers=", ".join(numbers))]
        ) from error
    if "" in numbers[:2]:
        raise Problems([say("x or y is empty.")])
    return entry_of(name, x, y, heading)


def file_text(places: Iterable[PlaceEntry]) -> str:
    """Return these places as the content of a file, which `read` can read."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(COLUMNS)
    lines.writerows((place.name, place.x, place.y, place.heading) for place in places)
    return text.getvalue()
