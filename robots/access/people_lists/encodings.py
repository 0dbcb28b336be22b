"""From the bytes of a file to its text. Most files do not say their encoding: it is a guess that people check."""

from __future__ import annotations

import codecs
import re

from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from msgspec import Struct

from robots.access.people_lists.columns import Role, role_of

# Python's names, in the order in which the preview offers them.
ENCODINGS = {
    "utf-8": gettext_lazy("UTF-8"),
    "utf-16": gettext_lazy("UTF-16 (Excel: Unicode text)"),
    "utf-32": gettext_lazy("UTF-32"),
    "cp1252": gettext_lazy("Windows-1252 (Western Europe)"),
    "iso8859_15": gettext_lazy("ISO 8859-15 (Western Europe)"),
    "mac_roman": gettext_lazy("Mac Roman (old Macs)"),
    "cp850": gettext_lazy("DOS 850 (Western Europe)"),
    "cp1250": gettext_lazy("Windows-1250 (Central Europe)"),
    "iso8859_2": gettext_lazy("ISO 8859-2 (Central Europe)"),
    "mac_latin2": gettext_lazy("Mac Central Europe"),
    "cp852": gettext_lazy("DOS 852 (Central Europe)"),
    "cp1257": gettext_lazy("Windows-1257 (Baltic)"),
    "cp1254": gettext_lazy("Windows-1254 (Turkish)"),
    "iso8859_9": gettext_lazy("ISO 8859-9 (Turkish)"),
    "mac_turkish": gettext_lazy("Mac Turkish"),
    "cp857": gettext_lazy("DOS 857 (Turkish)"),
    "cp1253": gettext_lazy("Windows-1253 (Greek)"),
    "iso8859_7": gettext_lazy("ISO 8859-7 (Greek)"),
    "mac_greek": gettext_lazy("Mac Greek"),
    "cp737": gettext_lazy("DOS 737 (Greek)"),
    "cp1251": gettext_lazy("Windows-1251 (Cyrillic)"),
    "koi8_r": gettext_lazy("KOI8-R (Cyrillic)"),
    "cp866": gettext_lazy("DOS 866 (Cyrillic)"),
    "iso8859_5": gettext_lazy("ISO 8859-5 (Cyrillic)"),
    "mac_cyrillic": gettext_lazy("Mac Cyrillic"),
    "cp1255": gettext_lazy("Windows-1255 (Hebrew)"),
    "cp1256": gettext_lazy("Windows-1256 (Arabic)"),
    "shift_jis": gettext_lazy("Shift JIS (Japanese)"),
    "euc_jp": gettext_lazy("EUC-JP (Japanese)"),
    "gb18030": gettext_lazy("GB 18030 (Chinese)"),
    "big5": gettext_lazy("Big5 (Chinese)"),
    "euc_kr": gettext_lazy("EUC-KR (Korean)"),
}
_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",  # begins with the mark of UTF-16
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
# Windows-1252 contains all letters of Latin-1. The next ones are taken where they fit better.
# The last ones give a letter to nearly any two bytes.
_GUESSES = (
    *("cp1252", "iso8859_15", "mac_roman", "cp850", "cp1250", "iso8859_2", "cp1254", "cp1251", "koi8_r"),
    *("cp1253", "iso8859_7", "mac_latin2", "cp852", "cp866", "cp857", "iso8859_5", "mac_cyrillic"),
    *("mac_turkish", "mac_greek", "cp737", "shift_jis", "euc_jp", "gb18030", "euc_kr", "big5"),
)
_JUDGED_LINES = 200  # with letters that are not ASCII: enough to tell the encoding
_JUDGED_LETTERS = 200  # of a line
_NOT_ASCII = re.compile(r"[^\x00-\x7f]")
_HEADER_LINES = 10
_SCRIPTS = {"latin": range(0x250), "greek": range(0x370, 0x400), "cyrillic": range(0x400, 0x530)}
# Latin letters beside ASCII that stand together in a line: Western Europe (a class has names of several languages),
# Portuguese, Western Europe with ø (without letters that Czech bytes give beside it), Icelandic, Polish, Czech, Slovak,
# Hungarian, Romanian, Croatian and Slovenian, Turkish, Estonian.
_ALPHABETS = [
    frozenset(letters)
    for letters in (
        *("àáâãäåæçèéêëìíîïñòóôöùúûüÿœß", "àáâãçéêíñóôõöúü", "àâãäåæçéêëîïñòóôöøúûüß", "áéíóúýþæöð"),
        *("ąćęłńóśźż", "áčďéěíňóřšťúůýž", "áäčďéíĺľňóôŕšťúýž", "áéíóöőúüű", "ăâîşţșț", "čćđšž"),
        *("çğıöşüâî", "äõöüšž"),
    )
]
_NARROW_KANA = range(0xFF61, 0xFFA0)  # one byte each in Shift JIS; not in names
_PUNCTUATION = "\u2018\u2019\u201c\u201d\u201e\u2013\u2014\u2026\u00ab\u00bb\u00b7\u00b4\u00ba\u00aa\u00a0"


class Decoded(Struct, frozen=True):
    """A file's text. `certain`: the bytes themselves prove the encoding."""

    text: str
    encoding: str
    certain: bool = True


class NotInEncodingError(ValueError):
    """The bytes are no text in the chosen encoding. Its message is for the person."""


def decoded(content: bytes, encoding: str = "") -> Decoded:
    """Return the text of a file in `encoding`, a key of `ENCODINGS`; "": in the one that fits.

    Raises `NotInEncodingError` if bytes have no meaning in the chosen encoding: no letter is replaced or lost.
    """
    if encoding:
        try:
            return Decoded(content.decode(_with_mark(content, encoding)), encoding)
        except (UnicodeDecodeError, UnicodeError) as error:
            text = _("The file is not in %(encoding)s: choose another encoding.")
            raise NotInEncodingError(text % {"encoding": ENCODINGS[encoding]}) from error
    for mark, codec in _MARKS.items():
        if content.startswith(mark) and (found := _text(content, codec)) is not None:
            return Decoded(found, codec.removesuffix("-sig"))
    for codec in _utf_16_without_mark(content):
        if (found := _text(content, codec)) is not None:
            return Decoded(found, "utf-16")
    if (found := _text(content, "utf-8")) is not None:
        return Decoded(found, "utf-8")
    texts = {codec: found for codec in _GUESSES if (found := _text(content, codec)) is not None}
    best = min(texts, key=lambda codec: _oddness(texts[codec]))
    return Decoded(texts[best], best, certain=False)


def _with_mark(content: bytes, encoding: str) -> str:
    """Return the codec that drops a byte order mark; UTF-16 without a mark is little-endian, as Windows writes it."""
    if encoding == "utf-8":
        return "utf-8-sig"
    if encoding == "utf-16" and not content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return next(iter(_utf_16_without_mark(content)), "utf-16-le")
    return encoding


def _utf_16_without_mark(content: bytes) -> list[str]:
    """Return the byte order in which every other byte of an address or a separator is zero."""
    start = content[:400]
    even, odd = start[::2].count(0), start[1::2].count(0)
    if max(even, odd) <= len(start) // 8:
        return []
    return ["utf-16-le" if odd > even else "utf-16-be"]


def _text(content: bytes, codec: str) -> str | None:
    try:
        return content.decode(codec)
    except (UnicodeDecodeError, UnicodeError):
        return None


def _oddness(text: str) -> tuple[int, int, int]:
    """Return how little a text looks like a list of people: without known titles first, then by its letters, then by
    its lines whose letters are of no language, in fifths: a few lines may have names of two languages.
    """
    lines = [line[:_JUDGED_LETTERS] for line in text.splitlines()]
    header = [line for line in lines[:_HEADER_LINES] if "@" not in line]
    cells = re.split(r"[\t;,|\"\n]", "\n".join(header))
    titles = sum(role_of(cell) is not Role.UNUSED for cell in cells)
    judged = [line for line in lines if not line.isascii()][:_JUDGED_LINES]
    mixed = sum(map(_is_of_no_language, judged))
    return -titles, sum(map(_oddities, judged)), 5 * mixed // max(len(judged), 1)


def _oddities(line: str) -> int:
    """Return how many characters stand where names have none: symbols, a capital within small letters, letters of
    another script beside this one.
    """
    odd = 0
    for found in _NOT_ASCII.finditer(line):
        letter, at = found[0], found.start()
        before, after = line[at - 1 : at], line[at + 1 : at + 2]
        amid = letter.isupper() and (before.islower() or (before.isalpha() and after.islower()))
        foreign = not {_script(before), _script(after)} <= {_script(letter), ""}
        strange = amid or foreign or ord(letter) in _NARROW_KANA or not letter.isalpha()
        odd += strange and letter not in _PUNCTUATION
    return odd


def _is_of_no_language(line: str) -> bool:
    # The small form of a Turkish I with dot has two characters
    small = {letter.lower()[0] for letter in _NOT_ASCII.findall(line) if _script(letter) == "latin"}
    latin = {letter for letter in small if not letter.isascii()}
    return not any(latin <= alphabet for alphabet in _ALPHABETS)


def _script(letter: str) -> str:
    """Return the script of a letter; "" for other characters, or none."""
    if not letter.isalpha():
        return ""
    return next((name for name, codes in _SCRIPTS.items() if ord(letter) in codes), "other")
