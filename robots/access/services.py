"""Writing access. Each change and its audit record are one transaction."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from datetime import date, datetime
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import UUID

from django.db import transaction

from fleet.audit.command_line import SystemAccount
from fleet.audit.services import record
from robots.access.models import Course, GroupRole, Qualification, QualificationGrant, RobotGroup
from robots.access.signals import course_opened, publish_access_changed
from robots.registry.models import Robot, RobotRole, Role

if TYPE_CHECKING:
    from fleet.accounts.models import User

    Actor = User | SystemAccount | None  # None: the console itself


@transaction.atomic
def role_set(*, robot: Robot, user: User, role: Role | None, actor: Actor) -> None:
    """Give `user` this role on `robot`; it replaces an earlier role. None takes the role away."""
    place = {"robot": robot, "user": user}
    _replace_role(RobotRole, place, role, actor, {}, robot_id=robot.id, robot_name=robot.name)


@transaction.atomic
def group_role_set(*, group: RobotGroup, user: User, role: Role | None, actor: Actor) -> None:
    """Give `user` this role on every robot of a group; it replaces an earlier role. None takes the role away."""
    _replace_role(GroupRole, {"group": group, "user": user}, role, actor, {"group": group.slug})


def _replace_role(
    table: type[RobotRole] | type[GroupRole],
    place: dict[str, Any],
    role: Role | None,
    actor: Actor,
    facts: dict[str, str],
    **robot: Any,
) -> None:
    """Store and record a person's role at a place: a robot or a group."""
    user: User = place["user"]
    held = table.objects.select_for_update().filter(**place).first()
    before, after = held.role if held else None, role.value if role else None
    if before == after:
        return
    if after is None:
        table.objects.filter(**place).delete()
    else:
        table.objects.update_or_create(**place, defaults={"role": after})
    parameters = {"user": str(user.pk), **facts, "from": before, "to": after}
    record("role.change", actor=actor, parameters=parameters, private={"name": user.display_name}, **robot)
    publish_access_changed([user.pk])


# --- groups, courses, qualifications --------------------------------------------------------------


@transaction.atomic
def group_save(*, group: RobotGroup, robots: Collection[Robot], actor: Actor) -> RobotGroup:
    """Make a robot group, or save its changes. Raises `ValidationError`."""
    if _save("group", group, {"robots": robots}, actor):
        publish_access_changed(None)
    return group


@transaction.atomic
def group_delete(*, group: RobotGroup, actor: Actor) -> None:
    """Delete a robot group: roles, courses and qualifications of the group no longer apply to its robots."""
    record("group.delete", actor=actor, parameters={"group": group.slug})
    group.delete()
    publish_access_changed(None)


@transaction.atomic
def course_save(
    *,
    course: Course,
    robots: Collection[Robot],
    groups: Collection[RobotGroup],
    supervisors: Collection[User],
    actor: Actor,
) -> Course:
    """Make a course, or save its changes. Raises `ValidationError`."""
    before = [] if course._state.adding else _people_of(course)  # a supervisor may be taken out
    if _save("course", course, {"robots": robots, "groups": groups, "supervisors": supervisors}, actor):
        publish_access_changed({*before, *_people_of(course)})
    return course


@transaction.atomic
def course_archive(*, course: Course, archived: bool, actor: Actor) -> None:
    """Archive a course (its roles end at once), or open it again."""
    if Course.objects.filter(pk=course.pk, archived=not archived).update(archived=archived):
        parameters = {"course": course.slug}
        if archived:
            record("course.archive", actor=actor, parameters=parameters)
        else:
            record("course.reopen", actor=actor, parameters=parameters)
        publish_access_changed(_people_of(course))
        if not archived:
            course_opened.send(sender=Course, course=course)


@transaction.atomic
def qualification_save(
    *,
    qualification: Qualification,
    robots: Collection[Robot],
    groups: Collection[RobotGroup],
    actor: Actor,
) -> Qualification:
    """Make a qualification, or save its changes. Raises `ValidationError`."""
    _save("qualification", qualification, {"robots": robots, "groups": groups}, actor)
    publish_access_changed(None)
    return qualification


@transaction.atomic
def qualification_delete(*, qualification: Qualification, actor: Actor) -> None:
    """Delete a qualification: no robot demands the qualification any more."""
    record("qualification.delete", actor=actor, parameters={"qualification": qualification.slug})
    qualification.delete()


@transaction.atomic
def qualification_grant(
    *, qualification: Qualification, people: Collection[User], expires_at: datetime | None, actor: User
) -> int:
    """Grant a qualification to these people, or change the end of their grants. Returns how many grants changed."""
    held = QualificationGrant.objects.select_for_update().filter(
        qualification=qualification, person__in=people
    )
    same = set(held.filter(expires_at=expires_at).values_list("person_id", flat=True))
    changed = [person for person in people if person.pk not in same]
    if not changed:
        return 0
    grants = [
        QualificationGrant(
            qualification=qualification, person=person, granted_by=actor, expires_at=expires_at
        )
        for person in changed
    ]
    QualificationGrant.objects.bulk_create(
        grants,
        update_conflicts=True,
        unique_fields=["qualification", "person"],
        update_fields=["granted_by", "granted_at", "expires_at"],
    )
    record(
        "qualification.grant",
        actor=actor,
        parameters={
            "qualification": qualification.slug,
            "people": [str(person.pk) for person in changed],
            "expires_at": expires_at.isoformat() if expires_at else None,
        },
    )
    publish_access_changed(person.pk for person in changed)
    return len(changed)


@transaction.atomic
def qualification_revoke(*, qualification: Qualification, people: Collection[User], actor: User) -> int:
    """Take the qualification from these people. Returns how many of them had it."""
    held = QualificationGrant.objects.select_for_update().filter(
        qualification=qualification, person__in=people
    )
    gone = [str(person) for person in held.values_list("person", flat=True)]
    if gone:
        held.delete()
        facts = {"qualification": qualification.slug, "people": gone}
        record("qualification.revoke", actor=actor, parameters=facts)
        publish_access_changed(UUID(person) for person in gone)
    return len(gone)


def _people_of(course: Course) -> list[UUID]:
    return [
        *course.enrolments.values_list("person", flat=True),
        *course.supervisors.values_list("pk", flat=True),
    ]


Entry = TypeVar("Entry", RobotGroup, Course, Qualification)


def _save(what: str, entry: Entry, lists: dict[str, Collection[Any]], actor: Actor) -> bool:
    """Check, save and record an entry and its lists. Returns whether an entry that is not new has changed."""
    entry.full_clean()
    new = entry._state.adding
    stored = None if new else type(entry)._default_manager.select_for_update(no_key=True).get(pk=entry.pk)
    before = {} if stored is None else _entered(stored)
    listed = {name: [] if stored is None else _keys(getattr(stored, name).all()) for name in lists}
    entry.save()
    for name, chosen in lists.items():
        getattr(entry, name).set(chosen)
    before |= listed
    after = _entered(entry) | {name: _keys(chosen) for name, chosen in lists.items()}
    changes = [
        {"field": name, "from": before.get(name), "to": value}
        for name, value in after.items()
        if value != before.get(name)
    ]
    if new or changes:
        step = "create" if new else "change"
        record(f"{what}.{step}", actor=actor, parameters={what: entry.slug, "changes": changes})
    return bool(changes) and not new


def _entered(entry: Entry) -> dict[str, Any]:
    """Return the columns as JSON values."""
    values = {field.name: field.value_from_object(entry) for field in entry._meta.concrete_fields}
    return {
        name: value.isoformat() if isinstance(value, date) else value
        for name, value in values.items()
        if name != "id"
    }


def _keys(entries: Iterable[Any]) -> list[str]:
    return sorted(getattr(entry, "slug", str(entry.pk)) for entry in entries)
