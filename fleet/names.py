"""Names that people choose: of accounts, robots, places, courses, tokens, and short texts beside them.

Every door asks `fault_of`: forms and the admin by `NameField`, REST and lists by their services. A name is one line of
letters that all people can see. `folded` and `shape` are the forms in which names are compared.
"""

# ruff: noqa: RUF001  # letters that look like others are the subject

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Iterator
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
_UNSEEN = (
    "Cc",
    "Cf",
    "Cs",
    "Co",
    "Cn",
    "Zl",
    "Zp",
)  # controls, line ends, formats such as bidi overrides, unassigned
_MOST_MARKS = 3  # on one letter; more of them cover the lines around
_EAST_ASIAN = {
    "CJK",
    "HIRAGANA",
    "KATAKANA",
    "HANGUL",
    "BOPOMOFO",
}  # written together, and with Latin letters


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
    if any(not _is_seen(name, place) for place in range(len(name))):
        return UNSEEN
    marks = 0
    for letter in unicodedata.normalize("NFC", name):
        marks = marks + 1 if unicodedata.category(letter) in ("Mn", "Me") else 0
        if marks > _MOST_MARKS:
            return UNSEEN
    if folded(name) in _NOBODY:
        return WORD
    return None


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


def folded(name: str) -> str:
    """Return a name in the form that is compared: without differences of case, width, spaces and composition."""
    shown = "".join(letter for letter in name if letter not in _JOINERS and not _BLANK.match(letter))
    return " ".join(unicodedata.normalize("NFKC", shown).casefold().split())


def shape(name: str) -> str:
    """Return how a name looks, case apart: letters of other scripts become the Latin ones that look the same."""
    return folded(name).translate(_LATIN).casefold()


def _exact_shape(name: str) -> str:
    return unicodedata.normalize("NFKC", name).translate(_LATIN).translate(_SAME_SCRIPT)


class Looks:
    """The names that others have: `alike(name)` finds one that looks the same and is spelled differently.

    The same spelling is no fault here: people may have the same name. An e-mail address as a name is proven by letters,
    so digits in it may look like letters.
    """

    def __init__(self, names: Collection[str]) -> None:
        self._spelled = {folded(name) for name in names}
        self._seen = {look for name in names for look in _looks(name)}

    def alike(self, name: str) -> bool:
        """Return whether the name looks like one of these, but is another."""
        return folded(name) not in self._spelled and not self._seen.isdisjoint(_looks(name))

    def add(self, name: str) -> None:
        """Add the name of a new account of a list."""
        self._spelled.add(folded(name))
        self._seen.update(_looks(name))


def _looks(name: str) -> Iterator[tuple[str, str]]:
    """Yield the two looks of a name: case apart, and as it stands, where I is no i."""
    if name:
        yield "case apart", shape(name)
        if "@" not in name:
            yield "exact", _exact_shape(name)


def _is_seen(text: str, place: int) -> bool:
    letter = text[place]
    before = text[place - 1] if place else ""
    if letter in _JOINERS:
        return bool(before) and (unicodedata.combining(before) == 9 or _script(before) == "ARABIC")
    if _BLANK.match(letter):  # a variant of the sign before it
        return (
            letter >= "\ufe00"
            and bool(before)
            and (unicodedata.category(before) == "So" or _script(before) == "CJK")
        )
    return unicodedata.category(letter) not in _UNSEEN


def _scripts(word: str) -> set[str]:
    scripts = {_script(letter) for letter in word if unicodedata.category(letter) in ("Ll", "Lo")}
    return set() if scripts & _EAST_ASIAN else scripts


def _script(letter: str) -> str:
    """Return the first word of a character's name in Unicode: of a letter, its script."""
    return unicodedata.name(letter, "").split(" ")[0].split("-")[0]


def require(name: str, *rules: Any) -> None:
    """Raise `ValidationError` with a code if one of these rules (`fault_of` if none) refuses the name."""
    for rule in rules or (fault_of,):
        if fault := rule(name):
            raise ValidationError(str(fault.text), code=fault.code)


class NameField(_CharField):
    """A column for a name or short text that people choose. `rules`: what is asked of it."""

    def __init__(self, *args: Any, rules: tuple[Any, ...] = (fault_of,), **options: Any) -> None:
        super().__init__(*args, **options)
        self._rules = rules

    def run_validators(self, value: Any) -> None:
        """Check the rules, too."""
        super().run_validators(value)
        require(value, *self._rules)

    def deconstruct(self) -> Any:
        """Return the column for migrations: the rules are none of the database's business."""
        name, _path, args, options = super().deconstruct()
        return name, "django.db.models.CharField", args, options
