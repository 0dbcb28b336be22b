"""Phrases and allow-lists of profiles and robots in the admin."""

from __future__ import annotations

import re
from typing import Any

from django import forms
from django.contrib import admin, messages
from django.contrib.admin.helpers import AdminForm
from django.contrib.admin.widgets import AdminIntegerFieldWidget
from django.db import models, transaction
from django.db.models import F, QuerySet
from django.forms import BaseInlineFormSet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.urls import URLPattern, path, reverse
from django.utils.html import format_html
from django.utils.translation import gettext, ngettext
from django.utils.translation import gettext_lazy as _

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.audit.recorded_admin import RecordedAdmin
from fleet.base.formats.sentences import in_words
from fleet.base.web.kept_files import KeptFileForm
from robots.registry import phrases, services
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Allowance, Phrase, Robot, RobotProfile
from robots.registry.selectors import first_language


def save_entries(formset: Any, actor: User) -> None:
    """Save the entries that were added, changed or deleted on the page of a profile or robot."""
    for entry in formset.save(commit=False):
        services.entry_save(entry=entry, actor=actor)
    for entry in formset.deleted_objects:
        services.entry_delete(entry=entry, actor=actor)


MOST_ROWS = 50


class SpokenFormSet(BaseInlineFormSet):  # type: ignore[type-arg]  # not subscriptable at run time
    """Rows of inputs: the first `MOST_ROWS`, because a page and a form with thousands of inputs are too large.

    The others are in the entries' own list (`list_link`). For screen readers, each input has its column's name
    as a label.
    """

    def get_queryset(self) -> QuerySet[Any]:
        """Return the entries that are shown; of a form that was sent, those that it may name."""
        if not self.is_bound and not hasattr(self, "_queryset"):
            self._queryset = super().get_queryset()[:MOST_ROWS]
        return super().get_queryset()

    def add_fields(self, form: Any, index: int | None) -> None:
        super().add_fields(form, index)
        for field in form.fields.values():
            if field.label:
                field.widget.attrs["aria-label"] = field.label


def list_link(entries: QuerySet[Any], **owner: Any) -> str:
    """Return a link to the list of all entries of an owner. `owner`: name of the field, and key."""
    [(field, key)] = owner.items()
    options = entries.model._meta
    url = reverse(f"admin:{options.app_label}_{options.model_name}_changelist")
    words = gettext("%(name)s: all %(count)d") % {
        "name": options.verbose_name_plural,
        "count": entries.count(),
    }
    return format_html('<a href="{}?{}__exact={}">{}</a>', url, field, key, words)


class AllowanceInline(admin.TabularInline):  # type: ignore[type-arg]  # not subscriptable at run time
    """The allow-list of a profile or robot."""

    model = Allowance
    formset = SpokenFormSet
    extra = 0
    fields = ["what", "use", "name", "type", "role"]
    verbose_name_plural = _("allow-list (everything else is forbidden)")


class EntryAdmin(RecordedAdmin):
    """Entries of all profiles and robots. An entry cannot move to another owner."""

    list_select_related = ["profile", "robot"]

    @admin.display(description=_("of"), ordering="profile")
    def whose(self, entry: Phrase | Allowance) -> str:
        """Return the owner's name: a profile or a robot."""
        return gettext("every %s") % entry.profile if entry.profile else str(entry.robot)

    def get_readonly_fields(self, request: HttpRequest, obj: Any = None) -> list[str]:
        """Return the fields of the owner for an existing entry."""
        return ["profile", "robot"] if obj else []

    def save_model(self, request: HttpRequest, obj: Any, form: Any, change: bool) -> None:
        services.entry_save(entry=obj, actor=person_of(request))

    def delete_model(self, request: HttpRequest, obj: Any) -> None:
        services.entry_delete(entry=obj, actor=person_of(request))


@admin.register(Allowance)
class AllowanceAdmin(EntryAdmin):
    """All allow-lists."""

    list_display = ["name", "what", "use", "type", "role", "whose", "why_nothing"]
    list_select_related = ["profile", "robot__profile"]
    list_filter = ["what", "profile", "robot"]
    search_fields = ["name", "type"]

    @admin.display(description=_("has no effect because"), empty_value="")
    def why_nothing(self, entry: Allowance) -> str:
        """Return why the entry has no effect: a later edit of its owner, or a newer console, forbids it."""
        return entry.why_nothing


# The same order as on a robot's page: the profile's phrases, then the robot's own, each sorted by `order`.
WHOSE_FIRST = (F("profile__name").asc(nulls_last=True), "robot__name", "order", "id")


@admin.register(Phrase)
class PhraseAdmin(EntryAdmin):
    """All phrases, with import from and export to text files."""

    list_display = ["text", "language", "tags", "whose", "order"]
    list_editable = ["order"]
    list_filter = ["language", "profile", "robot"]
    search_fields = ["text", "tags"]
    ordering = WHOSE_FIRST
    actions = ["export"]
    formfield_overrides = {
        models.TextField: {"widget": forms.Textarea(attrs={"rows": 3, "cols": 80, "dir": "auto"})},
        # In the list, a screen reader does not take the column's title as the label of the input.
        models.PositiveIntegerField: {"widget": AdminIntegerFieldWidget(attrs={"aria-label": _("Order")})},
    }

    def changelist_view(
        self, request: HttpRequest, extra_context: dict[str, Any] | None = None
    ) -> HttpResponse:
        """Show the list, or save it in one transaction."""
        with transaction.atomic():
            if "_save" in request.POST:
                sent = [str(one) for name, one in request.POST.items() if re.fullmatch(r"form-\d+-id", name)]
                services.phrases_lock([int(one) for one in sent if re.fullmatch(r"[0-9]{1,18}", one)])
            return super().changelist_view(request, extra_context)

    def get_urls(self) -> list[URLPattern]:
        page = self.admin_site.admin_view(self.import_page)
        return [path("import/", page, name="robots_phrase_import"), *super().get_urls()]

    def import_page(self, request: HttpRequest) -> HttpResponse:
        """Show the import form, or import the file. Faults of the file appear next to its field."""
        form = ImportForm(request.POST or None, request.FILES or None)
        if not form.is_valid():
            if form.is_bound:
                form.repeat()
            own = [name for name in form.fields if name not in form.fields_of_kept_file]
            fieldsets = [(None, {"fields": own})]
            laid_out = AdminForm(form, fieldsets, {}, model_admin=self)  # type: ignore[arg-type]  # any form will do
            asked_for = {"title": gettext("Import phrases"), "adminform": laid_out}
            context = self.admin_site.each_context(request) | asked_for
            return render(request, "admin/robots/phrase/import.html", context)
        asked = form.cleaned_data
        new = services.phrases_import(
            owner=asked["owner"], lines=asked["lines"], actor=person_of(request), replace=asked["replace"]
        )
        text = ngettext("%(owner)s: %(count)d new phrase.", "%(owner)s: %(count)d new phrases.", new)
        self.message_user(request, text % {"owner": asked["owner"], "count": new}, messages.SUCCESS)
        return redirect("admin:robots_phrase_changelist")

    @admin.action(description=_("Export to a text file"))
    def export(self, request: HttpRequest, queryset: QuerySet[Phrase]) -> HttpResponse:
        """Export the chosen phrases in their order."""
        content = phrases.file_text(phrase.line for phrase in queryset.order_by(*WHOSE_FIRST))
        headers = {"Content-Disposition": 'attachment; filename="phrases.txt"'}
        return HttpResponse(content, content_type="text/plain; charset=utf-8", headers=headers)


class ImportForm(KeptFileForm):
    """A file of phrases and its owner."""

    profile = forms.ModelChoiceField(
        RobotProfile.objects.all(),
        required=False,
        label=_("Profile"),
        help_text=_("For every robot with this profile,"),
    )
    robot = forms.ModelChoiceField(
        Robot.objects.all(), required=False, label=_("Robot"), help_text=_("or for one robot.")
    )
    file = forms.FileField(
        label=_("File"), required=False, widget=forms.FileInput(attrs={"accept": ".txt,.tsv,text/plain"})
    )
    language = forms.CharField(
        max_length=35,
        required=False,
        label=_("Language"),
        help_text=_("Language of lines without one, such as en-GB. Empty: the robot’s first."),
    )
    replace = forms.BooleanField(
        required=False,
        label=_("Replace"),
        help_text=_("Replace the existing phrases; otherwise add to them."),
    )

    most_bytes = phrases.LARGEST_FILE_BYTES

    def clean(self) -> dict[str, Any]:
        """Check the file; add `owner` and `lines`."""
        asked = super().clean()
        profile, robot, language = asked.get("profile"), asked.get("robot"), asked.get("language")
        if (profile is None) == (robot is None):
            self.add_error(None, gettext("Name either a profile or a robot."))
        elif language and (why := phrases.why_no_language(language)):
            self.add_error("language", in_words(why))
        elif self.kept:
            asked["owner"] = profile or robot
            try:
                asked["lines"] = phrases.read(self.kept.content, language or first_language(asked["owner"]))
            except Problems as problems:
                self.add_error("file", [*map(in_words, problems.lines)])
        elif not self.has_error("file"):
            self.add_error("file", gettext("Choose a file."))
        return asked
