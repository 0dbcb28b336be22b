"""Every form with a file keeps the file when it is shown again."""

from __future__ import annotations

from collections.abc import Iterator

from django import forms
from django.urls import get_resolver

from fleet.base.web.kept_files import KeptFileForm


def _with_heirs(kind: type) -> Iterator[type]:
    yield kind
    for heir in kind.__subclasses__():
        yield from _with_heirs(heir)


def test_every_form_with_a_file_keeps_it() -> None:
    assert get_resolver().url_patterns  # imports all pages
    ours = {
        form
        for form in _with_heirs(forms.BaseForm)
        if form.__module__.startswith(("fleet.", "robots.", "teleop."))
        and any(isinstance(field, forms.FileField) for field in getattr(form, "base_fields", {}).values())
    }
    assert KeptFileForm in ours
    assert [form for form in ours if not issubclass(form, KeptFileForm)] == []
