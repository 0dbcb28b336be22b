"""The languages of the pages: that of the source, and those that have been translated into."""

from __future__ import annotations

from pathlib import Path

from django.conf.locale import LANG_INFO


def spoken(source: str, translations: Path) -> list[tuple[str, str]]:
    """Codes with their own names, the source's first; of `translations` what is compiled (docs/development.md)."""
    compiled = sorted(file.parent.parent.name for file in translations.glob("*/LC_MESSAGES/django.mo"))
    codes = [source, *(folder.replace("_", "-").lower() for folder in compiled)]
    return [(code, LANG_INFO.get(code, {}).get("name_local", code)) for code in codes]
