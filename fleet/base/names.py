"""Names that people choose: of accounts, robots, places, courses, tokens, and short texts beside them, such as reasons.

Every door asks `fault_of`: forms and the admin by `NameField`, REST and lists by their services. A name is one line of
letters that all people can see. `folded` and `shape` are the forms in which names are compared.
"""

# ruff: noqa: RUF001  # letters that look like others are the subject

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from django.core.exceptions import ValidationError
from django.db import models
from django.utils.functional import Promise
from django.utils.translation import gettext_lazy as _
from msgspec import Struct

# Words with a meaning of their own in addresses, filters and records: no user name, no slug.
RESERVED = frozenset(("all", "console", "me", "none", "null", "system"))
_NOBODY = frozenset(("console", "the console", "the console itself"))  # how the log names the console itself

# Letters of other scripts that look like Latin ones, and those (Unicode Technical Standard 39, confusables.txt).
_LOOKALIKES = {
    "ЅІЈАВЕКМНОРСТУХЬагеорсухѕіјѡѴѵҮүһҽӀӏԁԌԛԜԝꙇ": "SIJABEKMHOPCTYXbareopcyxsijwVvYyhelldGqWwi",  # Cyrillic
    "ͿΑΒΕΖΗΙΚΜΝΟΡΤΥΧαγινορσυϜϳϺᴦ": "JABEZHIKMNOPTYXayivopouFjMr",  # Greek
    "ՍՏՕագզհոռսցքօ": "USOwqqhnnugfo",  # Armenian
    "ⲅⲎⲒⲔⲘⲚⲞⲟⲢⲣⲤⲥⲦⲨⲬⳐ": "rHIKMNOoPpCcTYXL",  # Coptic
    "ᎠᎡᎢᎥᎩᎪᎫᎬᎳᎷᎻᎽᏀᏂᏃᏏᏒᏔᏕᏙᏚᏞᏟᏢᏦᏧᏳᏴꭵꮁꮃꮓꮩꮪꮯ": "DRTiYAJEWMHYGhZbRWSVSLCPKdGBirwzvsc",  # Cherokee
    "ꓐꓑꓒꓓꓔꓖꓗꓙꓚꓜꓝꓟꓠꓡꓢꓣꓦꓧꓪꓫꓬꓮꓰꓲꓳꓴ": "BPdDTGKJCZFMNLSRVHWXYAEIOU",  # Lisu
    "ყჿ": "yo",  # Georgian
}
_LATIN = {
    ord(letter): twin for row, twins in _LOOKALIKES.items() for letter, twin in zip(row, twins, strict=True)
}
_SAME_SCRIPT = str.maketrans("I1|0", "lllO")  # in many fonts

_JOINERS = "\u200c\u200d"  # zero width: right in Persian and in scripts of India, invisible elsewhere
# They show nothing, although their category is that of letters, marks or signs.
_BLANK = re.compile(
    "[\u034f\u115f\u1160\u17b4\u17b5\u180b-\u180f\u2800\u3164\ufe00-\ufe0f\uffa0\U000e0100-\U000e01ef]"
)
_NOT_COMPARED = re.compile(f"[{_JOINERS}]|{_BLANK.pattern}")
# Controls, line ends, formats such as bidi overrides, unassigned
_UNSEEN = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
# Marks on one letter; more of them cover the lines around. Burmese has four, so a mark of no script counts twice.
_MOST_MARKS = 6
_KEYCAP = "\u20e3"  # makes a key of a digit
# Written together, and with Latin letters
_EAST_ASIAN = {"CJK", "HIRAGANA", "KATAKANA", "HANGUL", "BOPOMOFO"}


if TYPE_CHECKING:
    _CharField = models.CharField[str, str]
else:
    _CharField = models.CharField  # not subscriptable at run time


class Fault(Struct, frozen=True):
    """Why a name is refused."""

    code: str
    text: str | Promise


UNSEEN = Fault(
    "name_unseen",
    _("There is a line end, a control character or an invisible character in it: type it again."),
)
MIXED = Fault(
    "name_mixed",
    _("A word of this name has letters of two scripts, which may look alike: type it in one script."),
)
WORD = Fault("name_reserved", _("This word has a meaning of its own in the console: choose another name."))


def fault_of(name: str) -> Fault | None:
    """Return why nobody may choose this name or short text; None: it is fine. An empty text is fine."""
    if name.isspace() or any(not _is_seen(name, place) for place in range(len(name))):
        return UNSEEN
    marks = 0
    for letter in unicodedata.normalize("NFC", name):
        is_mark = unicodedata.category(letter) in ("Mn", "Me")
        marks = marks + (2 if _script(letter) == "COMBINING" else 1) if is_mark else 0
        if marks > _MOST_MARKS:
            return UNSEEN
    return WORD if folded(name) in _NOBODY else None


def fault_of_person(name: str) -> Fault | None:
    """Return why this is no name of a person or an account; also a word of several scripts is refused."""
    if fault := fault_of(name):
        return fault
    return (
        MIXED
        if any(len(scripts) > 1 for scripts in map(_scripts, re.split(r"[\W\d_]+", folded(name))))
        else None
    )


def fault_of_word(name: str) -> Fault | None:
    """Return why this may not stand in an address: a user name, a slug."""
    return WORD if {folded(name), shape(name).casefold()} & RESERVED else None


def spelled_out(text: str) -> str:
    """Return a refused text for a sentence: each hidden character stands there by its number, and does nothing."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


def folded(name: str) -> str:
    """Return a name in the form that is compared: without differences of case, width, spaces and composition."""
    return " ".join(unicodedata.normalize("NFKC", _NOT_COMPARED.sub("", name)).casefold().split())


def shape(name: str) -> str:
    """Return how a name looks, case apart: letters of other scripts become the Latin ones that look the same."""
    return _shape(folded(name))


def _shape(compared: str) -> str:
    return compared.translate(_LATIN).casefold()


class Looks:
    """The names that others have: `alike(name)` finds one that looks the same and is spelled differently.

    The same spelling is no fault here: people may have the same name. Two letters of one script look different to its
    readers, such as the Greek letters sigma and omicron. An e-mail address as a name is proven by letters, so digits in
    it may look like letters.
    """

    def __init__(self, names: Collection[str] = ()) -> None:
        self._spelled: set[str] = set()
        self._seen: defaultdict[str, set[str]] = defaultdict(set)  # names by how they look in Latin letters
        for name in names:
            self.add(name)

    def alike(self, name: str) -> bool:
        """Return whether the name looks like one of these, but is another."""
        return folded(name) not in self._spelled and any(
            _may_be_taken_for(spelled, other)
            for look, spelled in _looks(name)
            for other in self._seen.get(look, ())
        )

    def add(self, name: str) -> None:
        """Add a name, such as that of a new account of a list."""
        self._spelled.add(folded(name))
        for look, spelled in _looks(name):
            self._seen[look].add(spelled)


def _looks(name: str) -> Iterator[tuple[str, str]]:
    """Yield the two looks of a name in Latin letters: case apart, and as it stands, where I is no i.

    With each look comes the name in its own letters, of the same length.
    """
    if name:
        compared = folded(name)
        yield f"case apart: {_shape(compared)}", compared
        if "@" not in name:
            spelled = unicodedata.normalize("NFKC", name).translate(_SAME_SCRIPT)
            yield f"exact: {spelled.translate(_LATIN).translate(_SAME_SCRIPT)}", spelled


def _may_be_taken_for(name: str, other: str) -> bool:
    """Return whether two names of one look differ only where their letters are of different scripts."""
    return all(one == two or _script(one) != _script(two) for one, two in zip(name, other, strict=True))


def _is_seen(text: str, place: int) -> bool:
    letter = text[place]
    if letter.isascii():
        return letter.isprintable()
    before, after = text[:place][-1:], text[place + 1 :][:1]
    if letter in _JOINERS:
        return bool(before) and _joins(before, after)
    if _BLANK.match(letter):  # a variant of the sign before it
        return bool(before) and _has_variants(before, letter, after)
    return unicodedata.category(letter) not in _UNSEEN


def _joins(before: str, after: str) -> bool:
    """Return whether a joiner between these changes how they are written."""
    if _script(before) == "ARABIC" or _is_virama(before):
        return True
    if _is_virama(after):  # Bengali and Kannada: the first letter keeps its form
        return unicodedata.category(before) == "Lo"
    return (_is_sign(before) or before == "\ufe0f") and _is_sign(after)  # one emoji of several


def _has_variants(before: str, selector: str, after: str) -> bool:
    """Return whether this selector chooses how the character before it is written."""
    if selector < "\ufe00":
        return "\u180b" <= selector != before and _script(before) == "MONGOLIAN"
    return _is_sign(before) or _script(before) == "CJK" or after == _KEYCAP


def _is_virama(letter: str) -> bool:
    return bool(letter) and unicodedata.combining(letter) == 9


def _is_sign(letter: str) -> bool:
    """Return whether this is a sign outside ASCII, such as an emoji, an arrow or a tone of skin."""
    return letter > "\x7f" and unicodedata.category(letter) in ("So", "Sm", "Sk")


def _scripts(word: str) -> set[str]:
    scripts = {_script(letter) for letter in word if unicodedata.category(letter) in ("Ll", "Lo")}
    return set() if scripts & _EAST_ASIAN else scripts


@lru_cache(4096)
def _script(letter: str) -> str:
    """Return the first word of a character's name in Unicode: of a letter, its script."""
    return unicodedata.name(letter, "").split(" ")[0].split("-")[0]


def require(name: str, rule: Callable[[str], Fault | None] = fault_of) -> None:
    """Raise `ValidationError` with a code if the rule refuses the name."""
    if fault := rule(name):
        raise ValidationError(str(fault.text), code=fault.code)


class NameField(_CharField):
    """A column for a name or short text that people choose."""

    def run_validators(self, value: Any) -> None:
        """Check the rules of names, too."""
        super().run_validators(value)
        require(value)

    def deconstruct(self) -> Any:
        """Return the column for migrations: the rules are none of the database's business."""
        name, _path, args, options = super().deconstruct()
        return name, "django.db.models.CharField", args, options
