"""The pages of robot groups and of qualifications: lists of small forms, for staff."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from django.contrib import messages
from django.db.models import Count
from django.http import HttpRequest, HttpResponse
from django.shortcuts import get_object_or_404, redirect, render
from django.utils.translation import gettext as _
from django.views.decorators.cache import never_cache
from django.views.decorators.http import require_http_methods, require_safe

from fleet.accounts.models import User
from fleet.accounts.requests import staff_of
from fleet.base.web.paging import list_address, page_of
from fleet.base.web.time_takers import may_take_time
from robots.access import services
from robots.access.models import GroupRole, Qualification, RobotGroup
from robots.access.pages.forms import GroupForm, QualificationForm
from robots.registry.models import Role

_STAFF_ONLY = "Only staff change robot groups and qualifications."
ROLES = dict(GroupRole._meta.get_field("role").flatchoices)  # the roles that can be given, in words


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@may_take_time
def groups(request: HttpRequest) -> HttpResponse:
    """Show, make, change and delete robot groups."""

    def save(form: Any, staff: User) -> None:
        services.group_save(group=form.instance, robots=list(form.cleaned_data["robots"]), actor=staff)

    def delete(entry: Any, staff: User) -> None:
        services.group_delete(group=entry, actor=staff)

    return _entries(request, GroupForm, "robot-groups", save, delete)


@never_cache
@require_http_methods(["GET", "HEAD", "POST"])
@may_take_time
def qualifications(request: HttpRequest) -> HttpResponse:
    """Show, make, change and delete qualifications."""

    def save(form: Any, staff: User) -> None:
        chosen = {name: list(form.cleaned_data[name]) for name in ("robots", "groups")}
        services.qualification_save(qualification=form.instance, actor=staff, **chosen)

    def delete(entry: Any, staff: User) -> None:
        services.qualification_delete(qualification=entry, actor=staff)

    return _entries(request, QualificationForm, "qualifications", save, delete)


@never_cache
@require_safe
def group_people(request: HttpRequest, slug: str) -> HttpResponse:
    """List the people with a role on a group's robots, with forms to give and take away roles."""
    staff_of(request, _STAFF_ONLY)
    group = get_object_or_404(RobotGroup, slug=slug)
    roles = group.roles.select_related("user").order_by("user__full_name", "user__username")
    page = page_of(request, roles, "user__full_name", "user__username")
    return render(request, "access/group_people.html", {"group": group, "page": page, "roles": ROLES.items()})


def _give(request: HttpRequest, group: RobotGroup, staff: User) -> None:
    """Give a person a role on the group's robots, or take the role away."""
    name, role = request.POST.get("username", "").strip(), request.POST.get("role", "")
    person = User.objects.filter(username=name, is_active=True).first()
    if person is None:
        messages.error(request, _("There is no open account with this user name."))
        return
    if role not in ("", *ROLES):
        messages.error(request, _("There is no such role. Choose one from the list."))
        return
    services.group_role_set(group=group, user=person, role=Role(role) if role else None, actor=staff)
    words = {"person": person.display_name, "group": group.name}
    text = (
        _("%(person)s has the role on %(group)s.")
        if role
        else _("%(person)s has no role of their own on %(group)s.")
    )
    messages.success(request, text % words)


def _entries(
    request: HttpRequest,
    form_class: type[GroupForm] | type[QualificationForm],
    page: str,
    save: Callable[[Any, User], None],
    delete: Callable[[Any, User], None],
) -> HttpResponse:
    """Show a form for each entry and an empty form for a new entry. The prefix of an entry's form is its slug."""
    staff = staff_of(request, _STAFF_ONLY)
    model: type[RobotGroup] | type[Qualification] = form_class._meta.model
    posted = None
    if request.method == "POST":
        slug = request.POST.get("entry", "")
        entry = get_object_or_404(model, slug=slug) if slug else model()
        if slug and isinstance(entry, RobotGroup) and request.POST.get("action") == "role":
            _give(request, entry, staff)
            return redirect(list_address(request, "robot-group-people", slug))
        if slug and request.POST.get("action") == "delete":
            delete(entry, staff)
            messages.success(request, _("%s is deleted.") % entry)
            return redirect(page)
        posted = form_class(request.POST, instance=entry, prefix=slug or "new")
        if posted.is_valid():
            save(posted, staff)
            messages.success(request, _("%s is saved.") % entry)
            return redirect(page)
    entries = model.objects.all()
    if model is RobotGroup:
        entries = entries.annotate(people=Count("roles"))
    forms = [
        posted if posted and posted.instance.pk == entry.pk else form_class(instance=entry, prefix=entry.slug)
        for entry in entries
    ]
    new = posted if posted and posted.instance.pk is None else form_class(prefix="new")
    context = {"forms": forms, "new": new, "page": page, "groups": model is RobotGroup}
    return render(request, "access/entries.html", context, status=400 if posted else 200)
