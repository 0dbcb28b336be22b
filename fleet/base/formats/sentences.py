"""Sentences about robots in the language of the person whose request runs (scripts: `formats/sentences.js`)."""

from __future__ import annotations

import gettext
from collections.abc import Callable, Mapping
from datetime import datetime
from functools import cache
from typing import Any

from django.conf import settings
from django.utils.formats import number_format
from django.utils.timezone import localtime
from django.utils.translation import get_language, to_locale

from fleet.base.formats.dates import dated
from robots.shared.sentences import Sentence, capitalised, filled
from robots.shared.wire import Worded


def in_words(sentence: str) -> str:
    """Return a sentence in the reader's language; a text that is none as it is."""
    return _translated(*sentence.parts) if isinstance(sentence, Sentence) else _translated(sentence)


def words_of(message: Worded, field: str = "text") -> str:
    """Return a sentence of a message in the reader's language."""
    said = getattr(message, "said", None) or {}
    return _translated(*said.get(field, [getattr(message, field)]))


@cache
def _catalogue(language: str) -> gettext.NullTranslations:
    return gettext.translation("sentences", settings.LOCALE_PATHS[0], [to_locale(language)], fallback=True)


def _translated(key: str, figures: Mapping[str, Any] | None = None, many: str = "") -> str:
    if not key:  # gettext would return the head of the catalogue
        return ""
    catalogue = _catalogue(get_language() or settings.LANGUAGE_CODE)
    text = catalogue.ngettext(key, many, figures["count"]) if many and figures else catalogue.gettext(key)
    return filled(text, figures, _shown) if figures else text


def _shown(value: Any, form: str) -> str:
    if isinstance(value, list):
        value = _translated(*value)
    elif isinstance(value, Sentence):
        value = in_words(value)
    if form in _FORMATS:
        return _FORMATS[form](value)
    if isinstance(value, float | int):
        return localised(value, form)
    return str(value)


def localised(value: float, form: str = "g") -> str:
    """Return a number in a format of Python, with the decimal sign of the reader's language."""
    return str(number_format(f"{value:{form}}", use_l10n=True, force_grouping=False))


def _age(age_s: float) -> str:
    if age_s < 120.0:
        return f"{localised(age_s, '.1f' if age_s < 60.0 else '.0f')} s"
    return f"{localised(age_s / 60.0, '.0f')} min"


def _moment(form: str) -> Callable[[Any], str]:
    def shown(at: Any) -> str:
        moment = datetime.fromisoformat(at) if isinstance(at, str) else at
        is_moment = isinstance(moment, datetime) and moment.tzinfo is not None
        return dated(localtime(moment) if is_moment else moment, form)

    return shown


_FORMATS: Mapping[str, Callable[[Any], str]] = {
    "fine": lambda value: localised(value, ".1f" if value >= 0.095 else ".2f"),
    "age": _age,
    "capital": capitalised,
    "bare": lambda text: text.rstrip("."),
    "clock": _moment("H:i"),
    "day": _moment("d M Y"),
    "when": _moment("D d M Y, H:i"),
}
