"""Forms with a file: when a form is shown again, it repeats the file, because a browser does not send it twice."""

from __future__ import annotations

from base64 import b64decode, b64encode
from typing import Any, cast

from django import forms
from django.core.exceptions import ValidationError
from django.http import QueryDict
from django.template.defaultfilters import filesizeformat
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from msgspec import Struct

from fleet.base.names import spelled_out


class KeptFile(Struct, frozen=True):
    """A file as the browser sent it, now or with an earlier try."""

    name: str
    content: bytes

    @property
    def size(self) -> str:
        """Return the size in words."""
        return filesizeformat(len(self.content))


class KeptFileForm(forms.Form):
    """A form with a field `file`. `clean` reads the file into `kept`, whether the form is right or wrong.

    A view that shows the form again calls `repeat` first, and its template includes `kept_file.html`. If a file was
    refused, the next try needs another file, or the word that there is none: nothing goes on without it in silence.
    """

    file = forms.FileField(required=False)
    content = forms.CharField(required=False, widget=forms.HiddenInput)
    file_name = forms.CharField(required=False, widget=forms.HiddenInput)
    without_file = forms.BooleanField(label=gettext_lazy("Leave this file out"), required=False)

    fields_of_kept_file = ("content", "file_name", "without_file")  # `kept_file.html` shows them
    most_bytes = 1_000_000  # in base64 a file must fit DATA_UPLOAD_MAX_MEMORY_SIZE
    kept: KeptFile | None = None

    def clean(self) -> dict[str, Any]:
        """Read the file: a new one, else the one of the last try. Raise `ValidationError` if it is missing now."""
        values: dict[str, Any] = super().clean() or self.cleaned_data
        file, content = values.get("file"), values.get("content")
        if file is not None and file.size > self.most_bytes:
            text = _("The file is larger than %(most)s MB: is it the right one?")
            self.add_error("file", text % {"most": f"{self.most_bytes / 1e6:g}"})
        elif file is not None:
            self.kept = KeptFile(self._name, file.read())
        elif content and self._name:
            self.kept = KeptFile(self._name, b64decode(content))
        elif self._name and not {"file", "content"} & set(self.errors):
            text = _("Choose the file %(name)s again, or another one; or tick “Leave this file out”.")
            self.add_error("file", text % {"name": self._name})
        return values

    def clean_content(self) -> str:
        """Return the content; refuse one that `repeat` did not write."""
        content: str = self.cleaned_data["content"]
        try:
            b64decode(content, validate=True)
        except ValueError as error:
            raise ValidationError(_("The file did not arrive whole: choose it again.")) from error
        return content

    def repeat(self, **read: str | list[str]) -> None:
        """Show the form with the file that it has. `read`: values of other fields, as the server understood them."""
        typed = cast(QueryDict, self.data).copy()
        read["content"] = b64encode(self.kept.content).decode() if self.kept else ""
        read["file_name"] = self._name
        for name, value in read.items():
            typed.setlist(name, value if isinstance(value, list) else [value])
        typed.pop("without_file", None)
        self.data = typed

    @property
    def _name(self) -> str:
        """Return the name of the file that the person chose, now or before; "" if there is none."""
        if "file" not in self.fields:
            return ""
        if chosen := self.files.get("file"):
            return spelled_out(str(chosen.name))
        if self.data.get("without_file"):
            return ""
        return spelled_out(self.data.get("file_name", "")) or (_("file") if self.data.get("content") else "")
