"""The audit log in the admin: lists, page by page, and a page for each record. Read only."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import Any
from urllib.parse import urlencode

from django.contrib import admin
from django.core.exceptions import BadRequest, PermissionDenied
from django.db.models import Q
from django.http import Http404, HttpRequest, HttpResponse, HttpResponseBase, JsonResponse
from django.template.response import TemplateResponse
from django.urls import URLPattern, path, reverse
from django.utils.functional import Promise
from django.utils.text import capfirst
from django.utils.timezone import now
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy
from django.views.decorators.http import require_POST, require_safe
from msgspec import Struct

from fleet.audit.kinds import Listing, kinds_listed
from fleet.audit.models import MotionRecord, Record, RefusalRecord, SpeechRecord
from fleet.audit.reading import exports, wording
from fleet.audit.reading.addresses import Link, address, beside, by_day, number, session_url_of
from fleet.audit.reading.forms import THE_CONSOLE, FilterForm, people_named
from fleet.audit.reading.listing import COUNTED, Row, Selection, row_of
from fleet.audit.recorded_admin import RecordedAdmin
from fleet.audit.retention import is_doubt_on_record
from fleet.base import zones

LISTS = {
    "audit_speechrecord": gettext_lazy("Speech"),
    "audit_motionrecord": gettext_lazy("Motion"),
    "teleop_controlsession": gettext_lazy("Control sessions"),
    "audit_refusalrecord": gettext_lazy("Refusals and gate"),
    "audit_record": gettext_lazy("Everything"),
}


class ReadOnly(RecordedAdmin):
    """Rows that nobody can add, change or delete by hand."""

    def has_add_permission(self, request: HttpRequest) -> bool:
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False


SUGGESTED = 20  # names of people at most that the filter suggests


class Line(Struct, frozen=True):
    """A row as the page shows it."""

    url: str
    at: datetime.datetime
    robot: str
    who: str
    what: str
    subject: str
    expired: bool
    outcome: str
    facts: list[str]
    session_url: str


class ListAdmin(ReadOnly):
    """A list that replaces the admin's own list, which would count and sort all rows."""

    outcomes_are: str | Promise = gettext_lazy("Outcome")

    def get_urls(self) -> list[URLPattern]:
        wrap = self.admin_site.admin_view
        return [
            path("", wrap(require_safe(self.changelist_view)), name=f"{self._name}_changelist"),
            path("export/", wrap(require_POST(self.export_view)), name=f"{self._name}_export"),
        ]

    def changelist_view(self, request: HttpRequest, extra_context: Any = None) -> HttpResponse:
        self._look(request)
        form = self.form_for(request)
        context = {
            **self.admin_site.each_context(request),
            **(extra_context or {}),
            "title": capfirst(self.opts.verbose_name_plural),
            "is_nav_sidebar_enabled": False,  # the page has a row of links to the lists
            "opts": self.opts,
            "lists": lists(self._name),
            "clock_is_doubted": is_doubt_on_record(now().date()),
            "form": form,
            "outcomes_are": self.outcomes_are,
            "clear": request.path,
        }
        if form.is_valid():
            context |= {"formats": exports.Format, "export": f"export/?{address(request)}"}
            context |= self.found(request, form)
        return TemplateResponse(request, "admin/audit/list.html", context)

    def form_for(self, request: HttpRequest) -> FilterForm:
        """Return the form with the list's filters."""
        raise NotImplementedError

    def found(self, request: HttpRequest, form: FilterForm) -> dict[str, Any]:
        """Return the template's data: `days` with `Line`s (`by_day`), `count`, links to pages (`beside`)."""
        raise NotImplementedError

    def export_view(self, request: HttpRequest) -> HttpResponseBase:
        """Export the records that match the URL's filters, as a file; the export is recorded."""
        self._look(request)
        form = self.form_for(request)
        if not form.is_valid():
            raise BadRequest("these filters are not valid")
        try:
            format_ = exports.Format(request.POST.get("format", ""))
        except ValueError as error:
            raise BadRequest(f"a format is one of {exports.Format.values}") from error
        return self.exported(request, form, format_)

    def exported(self, request: HttpRequest, form: FilterForm, format_: exports.Format) -> HttpResponseBase:
        """Return the response with the file."""
        raise NotImplementedError

    @property
    def _name(self) -> str:
        return f"{self.opts.app_label}_{self.opts.model_name}"

    def _look(self, request: HttpRequest) -> None:
        if not self.has_view_permission(request):
            raise PermissionDenied


class RecordsAdmin(ListAdmin):
    listing: Listing | None = None  # None: everything
    without: Sequence[str] = ()  # filters that this list does not show

    def get_urls(self) -> list[URLPattern]:
        view = self.admin_site.admin_view(require_safe(self.record_view))
        return [*super().get_urls(), path("<int:object_id>/change/", view, name=f"{self._name}_change")]

    def form_for(self, request: HttpRequest) -> FilterForm:
        return FilterForm(
            request.GET, kinds=self._kinds(), without=self.without, outcomes_are=self.outcomes_are
        )

    def found(self, request: HttpRequest, form: FilterForm) -> dict[str, Any]:
        """Return the template's data: each request with its outcome."""
        selection = Selection(form.listed(), self._kinds())
        page = selection.page(before=number(request, "before"), after=number(request, "after"))
        return {
            "days": by_day(request, [(zones.day_of(row.record.at), _line(row)) for row in page.rows]),
            "count": count_of(page.count),
            **beside(
                request,
                [row.number for row in page.rows],
                newer=page.newer,
                older=page.older,
                day_before=selection.day_beside(later=False),
                day_after=selection.day_beside(later=True),
            ),
        }

    def exported(self, request: HttpRequest, form: FilterForm, format_: exports.Format) -> HttpResponseBase:
        """Return the response with the file: each request with its outcome."""
        return exports.response(
            exports.records(Selection(form.wanted(), self._kinds()), format_),
            form.wanted(),
            actor=request.user,  # type: ignore[arg-type]  # signed in: this is the admin
            name=self.listing.value if self.listing else "everything",
        )

    def record_view(self, request: HttpRequest, object_id: int) -> HttpResponse:
        """Show one record with all its data."""
        self._look(request)
        record = Record.objects.select_related("actor", "real_actor", "content").filter(pk=object_id).first()
        if record is None:
            raise Http404(f"there is no record {object_id}")
        content = record.content_kept
        context = {
            **self.admin_site.each_context(request),
            "title": f"#{record.pk} {wording.label(record.kind)}",
            "is_nav_sidebar_enabled": False,
            "opts": self.opts,
            "lists": lists(""),
            "record": record,
            "line": _line(row_of(record)),
            "who": wording.who(record),
            "label": wording.label(record.kind),
            "parameters": list(wording.lines(record.parameters)),
            "content": content,
            "text": wording.worded(record.details).get("text", ""),
            "private": list(wording.lines(wording.worded(content.data))) if content else [],
            "expired": wording.expired(record),
            "related": _related(record),
            "session_url": session_url_of(record.session_id),
            "of_session": urlencode({"session": record.session_id or ""}),
        }
        return TemplateResponse(request, "admin/audit/record.html", context)

    def _kinds(self) -> list[str] | None:
        return None if self.listing is None else kinds_listed(self.listing)


@admin.register(SpeechRecord)
class SpeechAdmin(RecordsAdmin):
    """Texts that robots spoke."""

    listing = Listing.SPEECH
    without = ["kind"]


@admin.register(MotionRecord)
class MotionAdmin(RecordsAdmin):
    """Drives and motions."""

    listing = Listing.MOTION
    without = ["q"]


@admin.register(RefusalRecord)
class RefusalAdmin(RecordsAdmin):
    """Refusals and gate interventions."""

    listing = Listing.REFUSALS
    without = ["q"]
    outcomes_are = gettext_lazy("Reason")


@admin.register(Record)
class EverythingAdmin(RecordsAdmin):
    def get_urls(self) -> list[URLPattern]:
        view = self.admin_site.admin_view(require_safe(self.people_view))
        return [path("people/", view, name="audit_people"), *super().get_urls()]

    def people_view(self, request: HttpRequest) -> HttpResponse:
        """Return some names that contain the typed text."""
        self._look(request)
        part = request.GET.get("q", "").strip()[:100]
        names = dict.fromkeys(name for _pk, name in people_named(part, SUGGESTED))
        if part and part.casefold() in str(THE_CONSOLE).casefold():
            names[str(THE_CONSOLE)] = None
        return JsonResponse({"people": list(names)})


def lists(current: str) -> list[Link]:
    """Return the links to the lists of the log."""
    return [Link(text, reverse(f"admin:{name}_changelist"), name == current) for name, text in LISTS.items()]


# --- rows ----------------------------------------------------------------------------------------


def _line(row: Row) -> Line:
    record = row.record
    return Line(
        url=_url(record),
        at=record.at,
        robot=record.robot_name,
        who=wording.who(record),
        what=wording.label(record.kind),
        subject=wording.subject(record),
        expired=wording.expired(record),
        outcome=wording.outcome(row.outcome),
        facts=wording.facts([record, row.end] if row.end else [record]),
        session_url=session_url_of(record.session_id),
    )


def _related(record: Record) -> list[tuple[str, Record, str]]:
    """Return the record's request, outcomes and parts, oldest first: label, record, URL."""
    beside = Record.objects.filter(Q(pk=record.of_id) | Q(of=record)).order_by("pk")
    return [(wording.label(other.kind), other, _url(other)) for other in beside]


def _url(record: Record) -> str:
    return reverse("admin:audit_record_change", args=[record.pk])


# --- also for other apps' lists ------------------------------------------------------------------


def count_of(count: int | None) -> str:
    """Return the number of records as text; blank if it is not known."""
    if count is None:
        return ""
    return _("more than %s") % f"{COUNTED:,}" if count > COUNTED else f"{count:,}"
