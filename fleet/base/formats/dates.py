"""Dates and times as the reader's language writes them: 29 Nov 2026, 29 nov 2026, 29. Nov 2026."""

from __future__ import annotations

import re
from datetime import date
from typing import Any

from django.utils.formats import date_format
from django.utils.translation import get_language

from robots.shared.sentences import with_offset

# Changes of an English format (Django's letters) by language.
_SMALL_MONTH = (r"\bM\b", "b")
_CHANGES = {
    "ca": [_SMALL_MONTH, (r"\bj F Y\b", r"j E \\d\\e Y")],
    "de": [(r"\b([dj]) (?=[MF]\b)", r"\1. ")],
    "es": [_SMALL_MONTH, (r"\bj F Y\b", r"j \\d\\e F \\d\\e Y")],
    "fr": [_SMALL_MONTH],
}


def dated(moment: date, form: str) -> str:
    """Return a day or moment in an English format, as the reader's language writes it.

    A time of day that the clock shows twice has its offset. `moment`: in the reader's zone.
    """
    text = str(date_format(moment, in_language(form)))
    return with_offset(text, moment) if form.endswith("H:i") else text


def in_language(form: Any) -> Any:
    """Return a format in the reader's language. Django's names of formats, such as DATE_FORMAT, stay."""
    for pattern, change in _CHANGES.get((get_language() or "")[:2], ()):
        form = re.sub(pattern, change, form)
    return form
