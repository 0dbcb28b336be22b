"""From a workbook (.xlsx) to the text of its first sheet: a line for each row, cells with tabs between them."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Iterator
from decimal import Decimal, InvalidOperation
from xml.etree import ElementTree

from msgspec import Struct

START = b"PK\x03\x04"
MOST_BYTES = 40_000_000  # of a part, unpacked: a small file may unpack to a huge one
MOST_DIGITS = 20
MOST_ROWS, MOST_COLUMNS = 6000, 100  # more than a list may have, so that a longer one is refused in words
_MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_RELATION = "{http://schemas.openxmlformats.org/officeDocument/2006/relationships}id"


class Workbook(Struct, frozen=True):
    """The text of the first sheet, and the number of sheets."""

    text: str
    sheets: int


class NoWorkbookError(ValueError):
    """The file is no workbook that can be read."""


def read_workbook(content: bytes) -> Workbook:
    """Read an .xlsx file. Raises `NoWorkbookError`."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as parts:
            sheets = list(_xml(parts, "xl/workbook.xml").iter(f"{_MAIN}sheet"))
            places = {
                one.get("Id"): one.get("Target", "") for one in _xml(parts, "xl/_rels/workbook.xml.rels")
            }
            target = places[sheets[0].get(_RELATION)]
            strings = _strings(parts) if "xl/sharedStrings.xml" in parts.namelist() else []
            place = target.lstrip("/") if target.startswith("/") else f"xl/{target}"
            rows = list(_rows(_xml(parts, place), strings))
    except (
        zipfile.BadZipFile,
        ElementTree.ParseError,
        LookupError,
        ValueError,
        NotImplementedError,
    ) as error:
        raise NoWorkbookError(str(error)) from error
    text = io.StringIO()
    csv.writer(text, delimiter="\t", lineterminator="\n").writerows(rows)
    return Workbook(text.getvalue(), len(sheets))


def _xml(parts: zipfile.ZipFile, name: str) -> ElementTree.Element:
    if parts.getinfo(name).file_size > MOST_BYTES:
        raise NoWorkbookError("too large")
    with parts.open(name) as part:  # no more than it says: the size in the archive's list may be wrong
        return ElementTree.fromstring(part.read(MOST_BYTES))  # noqa: S314 - expat limits what entities expand to


def _strings(parts: zipfile.ZipFile) -> list[str]:
    """Return the texts that cells share. A text may have parts of several fonts, and readings, which are left out."""
    runs = f"{_MAIN}t", f"{_MAIN}r/{_MAIN}t"
    return [
        "".join(one.text or "" for path in runs for one in entry.iterfind(path))
        for entry in _xml(parts, "xl/sharedStrings.xml")
    ]


def _rows(sheet: ElementTree.Element, strings: list[str]) -> Iterator[list[str]]:
    """Yield the rows, also the empty ones between them: numbers of lines are those of the sheet."""
    last = 0
    for row in sheet.iter(f"{_MAIN}row"):
        number = int(row.get("r", last + 1))
        yield from ([] for _empty in range(min(number - last - 1, MOST_ROWS)))
        last = number
        if last > MOST_ROWS:
            return
        cells: dict[int, str] = {}
        for at, cell in enumerate(row.iter(f"{_MAIN}c")):
            place = _column(cell.get("r", "")) if cell.get("r") else at
            if place < MOST_COLUMNS:
                cells[place] = " ".join(_text(cell, strings).split())
        yield [cells.get(place, "") for place in range(max(cells, default=-1) + 1)]


def _column(reference: str) -> int:
    """Return the place of a column from 0: "A7" is 0, "AB7" is 27."""
    place = 0
    for letter in re.sub(r"[^A-Z]", "", reference):
        place = place * 26 + ord(letter) - 64
    return place - 1


def _text(cell: ElementTree.Element, strings: list[str]) -> str:
    kind, value = cell.get("t", "n"), cell.findtext(f"{_MAIN}v") or ""
    if kind == "s":
        return strings[int(value)] if value else ""
    if kind == "inlineStr":
        return "".join(run.text or "" for run in cell.iter(f"{_MAIN}t"))
    return _whole(value) if kind == "n" else value


def _whole(value: str) -> str:
    """Return a number as the sheet shows it: "1.23456789012E11" and "7.0" are whole numbers."""
    try:
        number = Decimal(value)
    except InvalidOperation:
        return value
    whole = number.is_finite() and number.adjusted() < MOST_DIGITS and number == number.to_integral_value()
    return str(int(number)) if whole else value
