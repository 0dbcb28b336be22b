"""The languages of the pages: the language of the source, and languages with a translation."""

from __future__ import annotations

from pathlib import Path

from django.conf import settings
from django.conf.locale import LANG_INFO


def spoken(source: str, translations: Path) -> list[tuple[str, str]]:
    """Return codes and own names of the languages: `source` first, then compiled `translations`.

    docs/development.md describes how to compile translations.
    """
    compiled = sorted(file.parent.parent.name for file in translations.glob("*/LC_MESSAGES/django.mo"))
    codes = [source, *(folder.replace("_", "-").lower() for folder in compiled)]
    return [(code, LANG_INFO.get(code, {}).get("name_local", code)) for code in codes]


def chosen(code: str) -> str:
    """Return the language if pages have it, else an empty text."""
    return code if code in dict(settings.LANGUAGES) else ""


def of_person(code: str) -> str:
    """Return the language of messages to a person with this choice: without one, that of the source."""
    return chosen(code) or settings.LANGUAGE_CODE
