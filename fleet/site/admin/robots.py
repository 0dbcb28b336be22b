"""The registry in the admin. `robots.registry.services` checks, saves and records all changes."""

from __future__ import annotations

import json
from itertools import count
from socket import gethostname
from typing import Any, ClassVar

from django import forms
from django.conf import settings
from django.contrib import admin, messages
from django.core.serializers.json import DjangoJSONEncoder
from django.db import models
from django.db.models import ProtectedError, QuerySet
from django.forms import ModelForm
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect
from django.template.loader import render_to_string
from django.urls import reverse
from django.utils.decorators import method_decorator
from django.utils.html import format_html, format_html_join
from django.utils.timezone import localtime
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from fleet.accounts.models import User
from fleet.accounts.requests import person_of
from fleet.audit.recorded_admin import RecordedAdmin
from fleet.base.formats.sentences import in_words, localised
from fleet.base.web.time_takers import may_take_time
from fleet.site.admin.robot_entries import AllowanceInline, SpokenFormSet, list_link, save_entries
from fleet.site.reached_fields import FIRST, OTHERS, ReachedFields, ros_of
from robots.access.services import role_set
from robots.registry import services, shipped_profiles
from robots.registry.bridge_hosts import free_addresses
from robots.registry.models import BridgeStatus, Robot, RobotProfile, RobotRole, Role, RosChoice
from robots.registry.selectors import free_slug, last_editor
from robots.shared.processes.one_supervisor import LOCK, supervised
from robots.shared.sentences import of_parts


class ReadableJSON(json.JSONEncoder):
    """JSON with indentation, for editing."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{**options, "indent": 2})


READABLE: dict[type[models.Field[Any, Any]], dict[str, Any]] = {
    models.JSONField: {
        "encoder": ReadableJSON,
        "widget": forms.Textarea(
            attrs={"rows": 8, "cols": 100, "class": "vLargeTextField json", "spellcheck": "false"}
        ),
    }
}


def rows(kind: str, example: str) -> forms.Textarea:
    """Return a text box for JSON. A script (static/js/admin/pairs.js) shows the JSON as rows of name and value."""
    extra = {"data-pairs": kind, "data-example": example, "rows": 4}
    return forms.Textarea(attrs={"class": "vLargeTextField json", "spellcheck": "false", **extra})


NETWORK_NOTES = {
    RosChoice.ONE: _(
        "ROS nodes call each other back by name, so names must resolve both ways. Most faults in a lab "
        "are here; the check after saving finds them. Example: advertised address 10.68.0.2, host "
        "aliases tiago-42c with the value 10.68.0.1."
    ),
    RosChoice.TWO: _(
        "Nodes find each other by multicast. Where it does not reach the robot, as in many wireless networks, write "
        "its addresses, or its discovery server."
    ),
}
ENDED = {BridgeStatus.State.DISABLED, BridgeStatus.State.STOPPED}  # true also while no supervisor runs


class RoleInline(admin.TabularInline):  # type: ignore[type-arg]  # not subscriptable at run time
    """Roles of people on this robot. A row shows its person: an input would ask the database for each name."""

    model = RobotRole
    formset = SpokenFormSet
    extra = 0
    fields = ["user", "role"]
    readonly_fields = ["user"]
    verbose_name_plural = _("people (staff may do everything without an entry)")

    def get_queryset(self, request: HttpRequest) -> QuerySet[RobotRole]:
        """Return the roles with their people, by name."""
        roles = super().get_queryset(request).select_related("user", "robot__profile")
        return roles.order_by("user__full_name", "user__username")

    def has_add_permission(self, request: HttpRequest, obj: Robot | None) -> bool:  # type: ignore[override]
        """Return False: `NewRoleInline` adds."""
        return False


class NewRoleInline(admin.TabularInline):  # type: ignore[type-arg]
    """Rows for new roles on this robot."""

    model = RobotRole
    formset = SpokenFormSet
    extra = 0
    autocomplete_fields = ["user"]
    verbose_name = _("person")
    verbose_name_plural = _("new people")

    def has_view_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Return False: `RoleInline` shows the others."""
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False


class FreshForm(ModelForm):  # type: ignore[type-arg]  # not subscriptable at run time
    """A form that refuses to save if the entry was saved by somebody else since the form was opened.

    Otherwise an old form could, for example, put a robot back into service.
    """

    as_of = forms.CharField(label="", widget=forms.HiddenInput, required=False)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if not self.instance._state.adding:
            self.initial["as_of"] = self.instance.updated_at.isoformat()

    def clean_as_of(self) -> str:
        """Raise `ValidationError` if the entry was saved since the form was opened."""
        as_of: str = self.cleaned_data["as_of"]
        if as_of and as_of != self.initial.get("as_of", as_of):  # a copy (*Save as new*) has no initial value
            text = gettext(
                "%s has saved this entry since you opened it. Nothing was saved. Open the page again."
            )
            raise forms.ValidationError(text % last_editor(self.instance))
        return as_of


EXAMPLES = {
    "master_uri": "http://tiago-42c:11311",
    "advertised_address": "10.68.0.2",
    "static_peers": "10.68.0.1",
    "discovery_server": "10.68.0.1:11811",
    "namespace": "/tiago1",
    "ros_setup": "/opt/ros/jazzy/setup.bash",
}


class RobotForm(ReachedFields, FreshForm):
    """The form of a robot. If the slug is empty, it is made from the name."""

    class Meta:
        widgets: ClassVar[dict[str, Any]] = {
            "host_aliases": rows("text", "tiago-42c=10.68.0.1"),
            "overrides": rows("grouped", "limits.forward_mps=0.5"),
        }

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if "slug" in self.fields:
            self.fields["slug"].required = False
        for name, example in EXAMPLES.items():
            if name in self.fields:
                self.fields[name].widget.attrs["placeholder"] = example
        if "bridge_address" in self.fields and (free := free_addresses()):
            self.fields["bridge_address"].help_text += " " + gettext("Free: %s") % ", ".join(free)

    def clean_slug(self) -> str:
        """Return the typed slug; if it is empty, a slug made from the name that no other robot has."""
        typed: str = self.cleaned_data["slug"]
        return typed or free_slug(Robot, self.cleaned_data.get("name", ""))


@method_decorator(may_take_time, name="change_view")
@admin.register(Robot)
class RobotAdmin(RecordedAdmin):
    """Robots. They cannot be deleted, because sessions and records refer to them; staff untick "enabled" instead."""

    list_display = [
        "name_with_ros",
        "slug",
        "kind",
        "enabled",
        "practice",
        "reached",
        "bridge_state",
        "check_link",
    ]
    list_filter = ["enabled", "practice", "profile"]
    list_select_related = ["profile", "bridge"]
    search_fields = ["name", "slug", "master_uri"]
    prepopulated_fields = {"slug": ["name"]}
    readonly_fields = ["bridge_state", "check_link", "lists", "updated_at"]
    form = RobotForm
    formfield_overrides = READABLE
    actions = ["copy_robots", "export_robots", "delete_robots"]
    inlines = [RoleInline, NewRoleInline, AllowanceInline]
    differences = (
        _("Differences from its kind"),
        {
            "classes": ["collapse"],
            "fields": ["practice", "drive_topic", "default_share", "max_share", "overrides", "stick"],
            "description": _(
                "Leave this as it is for a robot like all others of its profile. A change takes effect within "
                "3 s; this robot stops for it, other robots do not. Example of an override: "
                "limits.forward_mps with the value 0.5."
            ),
        },
    )

    def get_fieldsets(self, request: HttpRequest, obj: Robot | None = None) -> Any:
        """Return the parts of the form, with the fields of the ROS of the robot's profile."""
        ros = ros_of(request, obj)
        first = ["name", "slug", "profile", *FIRST[ros], "room", "enabled"]
        network = {
            "classes": ["collapse"],
            "fields": [*OTHERS[ros], "bridge_address"],
            "description": NETWORK_NOTES[ros],
        }
        return [
            (None, {"fields": [*first, "bridge_state", "check_link", "lists", "as_of"]}),
            (_("Network"), network),
            self.differences,
        ]

    def get_inlines(self, request: HttpRequest, obj: Robot | None) -> list[Any]:
        """A new robot has no roles yet."""
        return self.inlines[0 if obj else 1 :]

    @admin.action(description=_("Copy: the same settings, disabled"))
    def copy_robots(self, request: HttpRequest, queryset: QuerySet[Robot]) -> None:
        """Make a copy of each robot."""
        for robot in queryset:
            numbers = (gettext("%(name)s copy %(n)d") % {"name": robot.name[:60], "n": n} for n in count(1))
            name = next(one for one in numbers if not Robot.objects.filter(name__iexact=one).exists())
            copy = services.robot_copy(
                robot=robot, name=name, slug=free_slug(Robot, name), actor=person_of(request)
            )
            self.message_user(request, gettext("%s is made. Change its address, then enable it.") % copy.name)

    @admin.action(description=_("Export the settings (JSON)"))
    def export_robots(self, request: HttpRequest, queryset: QuerySet[Robot]) -> HttpResponse:
        """Return the settings of each robot, as the registry has them."""
        hidden = {"fence", "updated_at"}
        columns = [one for one in Robot._meta.concrete_fields if one.name not in hidden]
        found = [
            {one.name: one.value_from_object(robot) for one in columns} | {"profile": robot.profile.slug}
            for robot in queryset.select_related("profile")
        ]
        text = json.dumps(found, cls=DjangoJSONEncoder, indent=2, ensure_ascii=False)
        answer = HttpResponse(text, content_type="application/json")
        answer["Content-Disposition"] = 'attachment; filename="robots.json"'
        return answer

    @admin.action(description=_("Delete for good, if never booked or driven"))
    def delete_robots(self, request: HttpRequest, queryset: QuerySet[Robot]) -> None:
        """Delete disabled robots that nothing refers to."""
        for robot in queryset:
            if robot.enabled:
                text = gettext("%s is enabled: take it out of service first.")
                self.message_user(request, text % robot.name, messages.ERROR)
                continue
            try:
                services.robot_delete(robot=robot, actor=person_of(request))
            except ProtectedError:
                text = gettext("%s was booked or driven: it stays, because the log refers to it.")
                self.message_user(request, text % robot.name, messages.ERROR)
            else:
                self.message_user(request, gettext("%s is deleted.") % robot.name)

    @admin.display(description=_("name"), ordering="name")
    def name_with_ros(self, robot: Robot) -> str:
        """Return the name, and its ROS as other pages show it."""
        return format_html("{} {}", robot.name, render_to_string("robots/ros_badge.html", {"robot": robot}))

    @admin.display(description=_("profile"), ordering="profile__name")
    def kind(self, robot: Robot) -> str:
        """Return the profile's name without its ROS, which stands beside the robot's name."""
        return robot.profile.kind

    @admin.display(description=_("reached at"))
    def reached(self, robot: Robot) -> str:
        """Return its master, or its domain and namespace."""
        if robot.profile.ros == RosChoice.ONE:
            return robot.master_uri
        return f"{gettext('domain')} {robot.domain_id} {robot.namespace}".strip()

    @admin.display(description=_("bridge"))
    def bridge_state(self, robot: Robot) -> str:
        """Return the last reported state of the bridge process."""
        status = getattr(robot, "bridge", None)
        if status is None:
            return gettext("not seen by a supervisor yet")
        since = gettext("%(state)s since %(time)s") % {
            "state": status.get_state_display(),
            "time": f"{localtime(status.since):%Y-%m-%d %H:%M:%S %Z}",
        }
        is_elsewhere = status.host not in ("", gethostname())
        if is_elsewhere:
            since = gettext("%(state)s, on %(computer)s") % {"state": since, "computer": status.host}
        detail = of_parts(status.detail, status.said) if status.said else status.detail
        status_text = f"{since}: {in_words(detail)}" if detail or status.said else since
        if status.state in ENDED or is_elsewhere or supervised(settings.FLEET_RUN_DIR / LOCK):
            return status_text
        return gettext("no supervisor is running; the last report: %s") % status_text

    @admin.display(description=_("check"))
    def check_link(self, robot: Robot) -> str:
        """Return a link to the check page."""
        if robot._state.adding:
            return gettext("after saving")
        url = reverse("robot-check", args=[robot.slug])
        return format_html('<a href="{}">{}</a>', url, gettext("Check this robot"))

    @admin.display(description=_("lists"))
    def lists(self, robot: Robot) -> str:
        """Return links to all entries: below, only the first are shown."""
        if robot._state.adding:
            return gettext("after saving")
        links = [
            (list_link(entries, robot__id=robot.pk),)
            for entries in (robot.roles.all(), robot.allowances.all())
        ]
        return format_html_join(" · ", "{}", links)

    def save_model(self, request: HttpRequest, obj: Robot, form: ModelForm[Robot], change: bool) -> None:
        services.robot_save(robot=obj, actor=person_of(request))

    def response_add(
        self, request: HttpRequest, obj: Robot, post_url_continue: str | None = None
    ) -> HttpResponse:
        """Redirect to the check page, unless the person edits more."""
        response = super().response_add(request, obj, post_url_continue)
        return self._checked(request, obj) or response

    def response_change(self, request: HttpRequest, obj: Robot) -> HttpResponse:
        """Redirect to the check page, unless the person edits more."""
        response = super().response_change(request, obj)
        return self._checked(request, obj) or response

    def _checked(self, request: HttpRequest, robot: Robot) -> HttpResponse | None:
        """Return a redirect to the check page after *Save*; None if the person edits more or the robot is disabled."""
        stays = {"_continue", "_addanother", "_popup", "_saveasnew"} & set(request.POST)
        return None if stays or not robot.enabled else redirect("robot-check", robot.slug)

    def save_formset(self, request: HttpRequest, form: Any, formset: Any, change: bool) -> None:
        if formset.model is not RobotRole:
            save_entries(formset, person_of(request))
            return
        for entry in formset.save(commit=False):
            _give(entry, person_of(request))
        for entry in formset.deleted_objects:
            role_set(robot=entry.robot, user=entry.user, role=None, actor=person_of(request))

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        """Forbid deletion: robots are disabled instead."""
        return False


def _give(entry: RobotRole, actor: User) -> None:
    """Save a role as entered. If the row was changed to another person or robot, end the role that it was before."""
    before = RobotRole.objects.select_related("user", "robot").filter(pk=entry.pk).first()
    if before is not None and (before.user_id, before.robot_id) != (entry.user_id, entry.robot_id):
        role_set(robot=before.robot, user=before.user, role=None, actor=actor)
    role_set(robot=entry.robot, user=entry.user, role=Role(entry.role), actor=actor)


@method_decorator(may_take_time, name="change_view")
@method_decorator(may_take_time, name="delete_view")
@method_decorator(may_take_time, name="changelist_view")
@admin.register(RobotRole)
class RobotRoleAdmin(RecordedAdmin):
    """All roles of all people."""

    list_display = ["user", "robot", "role"]
    list_filter = ["role", "robot"]
    list_select_related = ["user", "robot"]
    search_fields = ["user__username", "user__full_name", "robot__name"]
    autocomplete_fields = ["user", "robot"]

    def save_model(
        self, request: HttpRequest, obj: RobotRole, form: ModelForm[RobotRole], change: bool
    ) -> None:
        _give(obj, person_of(request))

    def delete_model(self, request: HttpRequest, obj: RobotRole) -> None:
        role_set(robot=obj.robot, user=obj.user, role=None, actor=person_of(request))


@admin.register(RobotProfile)
class RobotProfileAdmin(RecordedAdmin):
    """Kinds of robots."""

    list_display = ["name", "slug", "holonomic", "forward_mps", "blind_mps", "drive_topic", "source"]
    readonly_fields = ["source", "lists", "updated_at"]
    form = FreshForm
    formfield_overrides = READABLE
    actions = ["take_shipped"]
    inlines = [AllowanceInline]
    save_as = True
    fieldsets = [
        (None, {"fields": ["name", "slug", "holonomic", "ros", "source", "lists", "as_of"]}),
        (
            _("Limits"),
            {
                "fields": [
                    *("forward_mps", "reverse_mps", "lateral_mps", "turn_radps"),
                    *("linear_mps2", "angular_radps2", "blind_mps"),
                ],
                "description": _(
                    "The safety gate's assumptions about the base. If a number is higher than the base can do, the "
                    "gate brakes too late."
                ),
            },
        ),
        (
            _("Driving"),
            {"fields": ["default_share", "reverse_steering", "stick", "drive_topic", "drive_type"]},
        ),
        (_("Body and ROS interface"), {"fields": ["footprint", "topics", "gate"]}),
    ]

    @admin.display(description=_("source"))
    def source(self, profile: RobotProfile) -> str:
        """Return whether the profile equals its data file."""
        file = shipped_profiles.file_of(profile)
        if file is None:
            return gettext("made here")
        if shipped_profiles.differs(profile, file):
            return gettext("edited here; the shipped one differs")
        return gettext("as shipped")

    @admin.display(description=_("lists"))
    def lists(self, profile: RobotProfile) -> str:
        """Return a link to all entries: below, only the first are shown."""
        if profile._state.adding:
            return gettext("after saving")
        return list_link(profile.allowances.all(), profile__id=profile.pk)

    @admin.action(description=_("Replace local edits by the shipped version"))
    def take_shipped(self, request: HttpRequest, queryset: QuerySet[RobotProfile]) -> None:
        """Restore the profiles from their data files."""
        for profile in queryset:
            taken = services.profile_take_shipped(profile=profile, actor=person_of(request))
            if taken:
                self.message_user(request, gettext("%s is now as shipped.") % profile.name, messages.SUCCESS)
            else:
                text = gettext("%s was made here; it has no shipped version.") % profile.name
                self.message_user(request, text, messages.WARNING)

    def save_model(
        self, request: HttpRequest, obj: RobotProfile, form: ModelForm[RobotProfile], change: bool
    ) -> None:
        """Save by the service, and warn if the blind speed was raised."""
        services.profile_save(profile=obj, actor=person_of(request))
        if change and "blind_mps" in form.changed_data and obj.blind_mps > form.initial["blind_mps"]:
            text = gettext(
                "The blind speed of every %(name)s is now %(now)s m/s (before: %(before)s). Where no sensor watches, "
                "only the operator does."
            )
            figures = {"now": localised(obj.blind_mps), "before": localised(form.initial["blind_mps"])}
            self.message_user(request, text % {"name": obj.name, **figures}, messages.WARNING)

    def save_formset(self, request: HttpRequest, form: Any, formset: Any, change: bool) -> None:
        save_entries(formset, person_of(request))

    def delete_model(self, request: HttpRequest, obj: RobotProfile) -> None:
        services.profile_delete(profile=obj, actor=person_of(request))

    def has_delete_permission(self, request: HttpRequest, obj: RobotProfile | None = None) -> bool:
        """Return whether the profile can be deleted: not if it is shipped (it would come back) or in use."""
        return obj is not None and shipped_profiles.file_of(obj) is None and not obj.robots.exists()
