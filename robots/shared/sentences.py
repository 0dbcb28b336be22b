"""English sentences that a page can say in another language: each keeps its key and its figures.

The key is the English sentence with named figures in braces, and the key in the catalogue (`fleet/locale`):
`say("{sensor} is {age:age} old", sensor=say("laser"), age=0.61)` is the text "laser is 0.6 s old". A figure that is a
sentence, or an error with one, is said in the reader's language, too; a plain text (a name, a topic) stays as it is. A
colon begins the format of a figure: one of Python's (`.1f`), or one of `FORMATS`; the same are
in `static/js/formats/sentences.js`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import date, datetime, timedelta
from functools import cache
from string import Formatter
from typing import Any

DIGITS = 4  # of a figure on the wire: as many as any format shows


class Sentence(str):
    """An English text with its key and figures. Any other text made from it is a plain text."""

    __slots__ = ("figures", "key", "many")
    key: str
    figures: Mapping[str, Any]
    many: str  # the key if the figure `count` is not one; empty: the sentence has one form

    @property
    def parts(self) -> list[Any]:
        """Return key, figures and `many` for the wire, as few as are needed."""
        figures = {name: _on_wire(value) for name, value in self.figures.items()}
        return [self.key, figures, self.many] if self.many else [self.key, figures] if figures else [self.key]


def catalogued(text: str) -> str:
    """Return a key that several places say, so that the catalogue has it."""
    return text


def say(key: str, **figures: Any) -> Sentence:
    """Return a sentence. All its figures stand in the key."""
    return _sentence(key, figures)


def counted(one: str, many: str, *, count: int, **figures: Any) -> Sentence:
    """Return the form of a sentence for `count`, which is one of its figures."""
    return _sentence(one, {"count": count, **figures}, many)


def joined(between: str, sentences: Sequence[str]) -> Sentence:
    """Return sentences in a row as one."""
    figures = {f"part{number}": sentence for number, sentence in enumerate(sentences)}
    return _sentence(between.join(f"{{{name}}}" for name in figures), figures)


def reason_of(error: BaseException) -> str:
    """Return the text of an error, with key and figures if it is a sentence."""
    first = error.args[0] if error.args else ""
    return first if isinstance(first, Sentence) else str(error)


def standing_alone(reason: str) -> Sentence:
    """Return a reason as a sentence with a capital letter and a full stop."""
    return _sentence("{reason:capital}" + "." * (not reason.endswith(".")), {"reason": reason})


def of_parts(text: str, parts: list[Any]) -> Sentence:
    """Return the sentence with this English text from key and figures that came by wire."""
    key, figures, many = (*parts, {}, "")[:3] if len(parts) < 2 else (*parts, "")[:3]
    return _sentence(key, figures, many, text)


def sentence_of(parts: list[Any]) -> Sentence:
    """Return a sentence from its stored parts. Figures that were sentences are sentences again."""
    key, figures, many = (*parts, {}, "")[:3] if len(parts) < 2 else (*parts, "")[:3]
    said = {name: sentence_of(one) if isinstance(one, list) else one for name, one in figures.items()}
    return _sentence(key, said, many)


def _sentence(key: str, figures: Mapping[str, Any], many: str = "", text: str | None = None) -> Sentence:
    figures = {name: reason_of(f) if isinstance(f, BaseException) else f for name, f in figures.items()}
    form = many if many and figures["count"] != 1 else key
    sentence = Sentence(filled(form, figures, _in_english) if text is None else text)
    sentence.key, sentence.figures, sentence.many = key, figures, many
    return sentence


def filled(key: str, figures: Mapping[str, Any], shown: Callable[[Any, str], str]) -> str:
    """Return a sentence with its figures, each as `shown` by value and format."""
    return "".join(
        text if name is None else text + shown(figures[name], form) for text, name, form in pieces(key)
    )


@cache
def pieces(key: str) -> tuple[tuple[str, str | None, str], ...]:
    """Return the key as pairs of text and figure: text, name, format. The last may have no figure (None)."""
    return tuple((text, name, form or "") for text, name, form, _ in Formatter().parse(key))


def _in_english(value: Any, form: str) -> str:
    return FORMATS[form](value) if form in FORMATS else format(value, form)


def _on_wire(value: Any) -> Any:
    if isinstance(value, Sentence):
        return value.parts
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, float):
        return round(float(value), DIGITS)  # a number of numpy cannot be sent
    return value if isinstance(value, int | list) else str(value)


def fine(number: float) -> str:
    """Return a distance or speed with as many digits as an operator can use: 0.6, but 0.08."""
    return f"{number:.1f}" if number >= 0.095 else f"{number:.2f}"


def age(age_s: float) -> str:
    """Return a duration in words: "0.6 s", "75 s", "14 min"."""
    if age_s < 60.0:
        return f"{age_s:.1f} s"
    return f"{age_s:.0f} s" if age_s < 120.0 else f"{age_s / 60.0:.0f} min"


def capitalised(text: str) -> str:
    """Return a text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def with_offset(clock: str, moment: Any) -> str:
    """Return a time of day, with its offset if clocks go back and show it twice that day: "02:30 (UTC+2)"."""
    return f"{clock} ({offset(moment)})" if is_shown_twice(moment) else clock


def is_shown_twice(moment: Any) -> bool:
    """Return whether clocks go back and show this moment's time of day twice. `moment`: in the reader's zone."""
    zone = getattr(moment, "tzinfo", None)
    return zone is not None and moment.replace(fold=0).utcoffset() != moment.replace(fold=1).utcoffset()


def offset(moment: datetime) -> str:
    """Return the offset from UTC of a moment in a zone: "UTC+2", "UTC-3:30"."""
    minutes = round((moment.utcoffset() or timedelta()) / timedelta(minutes=1))
    hours, rest = divmod(abs(minutes), 60)
    return f"UTC{'-' if minutes < 0 else '+'}{hours}" + (f":{rest:02}" if rest else "")


def _of_moment(shown: Callable[[Any], str]) -> Callable[[Any], str]:
    """Return the format for moments, and for their texts in stored sentences."""
    return lambda value: shown(datetime.fromisoformat(value) if isinstance(value, str) else value)


FORMATS: Mapping[str, Callable[[Any], str]] = {
    "fine": fine,
    "age": age,
    "capital": capitalised,
    "bare": lambda text: text.rstrip("."),
    # Moments in the reader's zone
    "clock": _of_moment(lambda moment: with_offset(f"{moment:%H:%M}", moment)),
    "day": _of_moment(lambda moment: f"{moment:%d %b %Y}"),
    "when": _of_moment(lambda moment: with_offset(f"{moment:%a %d %b %Y, %H:%M}", moment)),
}
