"""The rows that a change touches: as they were before, so that it can be undone.

All tables that give or take rights and times are read without and with a change. A lab has some thousand such rows,
and such changes are rare; no service needs to know how to undo what it does.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from django.db import DatabaseError, connection, models, transaction
from msgspec import Struct

from fleet.accounts.models import User
from fleet.bookings.models import Holiday, OutOfService, Policy
from robots.access.models import Course, Enrolment, GroupRole, Qualification, QualificationGrant, RobotGroup
from robots.access.selectors import courses_managed_by, demanded_in, robots_managed_by
from robots.registry.models import Robot, RobotRole

LOOKS = 5  # at what others change while a change is made

Rows = dict[Any, dict[str, Any]]  # by primary key
Tables = dict[type[models.Model], Rows]

# Rows come after those that they refer to.
_WHOLE: tuple[type[models.Model], ...] = (
    RobotGroup,
    Course,
    Qualification,
    RobotGroup.robots.through,
    Course.robots.through,
    Course.groups.through,
    Course.supervisors.through,
    Qualification.robots.through,
    Qualification.groups.through,
    RobotRole,
    GroupRole,
    Enrolment,
    QualificationGrant,
    Policy,
    OutOfService,
    Holiday,
)
_COLUMNS: dict[type[models.Model], tuple[str, ...]] = {
    User: ("is_active", "is_staff"),
    Robot: ("enabled",),
} | {model: tuple(one.attname for one in model._meta.concrete_fields) for model in _WHOLE}
_BY_LABEL = {model._meta.label: model for model in _COLUMNS}


class Row(Struct):
    """A row that a change made (`before` is None), removed (`after` is None) or changed."""

    table: str
    key: str
    before: dict[str, Any] | None
    after: dict[str, Any] | None


def rows_before() -> Tables | None:
    """Return the rows that a change may touch; None where others write meanwhile: see `rows_changed`."""
    return _rows_now() if connection.vendor == "sqlite" else None


def rows_changed(before: Tables | None) -> list[Row]:
    """Return the rows that this transaction has changed, and nobody else.

    Where others write meanwhile, another connection shows their rows without those of this transaction. What
    they commit between these two looks would count as changed here, so both see the same only if nothing moved.
    """
    after = _rows_now()
    for _ in range(0 if before is not None else LOOKS):
        with ThreadPoolExecutor(1) as beside:
            before = beside.submit(_rows_committed).result()
        seen, after = after, _rows_now()
        if seen == after:
            break
    return [row for model in _COLUMNS for row in _differing(model, (before or {})[model], after[model])]


def _rows_now() -> Tables:
    return {
        model: {row["pk"]: row for row in model._default_manager.values("pk", *columns)}
        for model, columns in _COLUMNS.items()
    }


def _rows_committed() -> Tables:
    """Return the rows as everybody else sees them. Runs in a thread, which has a connection of its own."""
    try:
        return _rows_now()
    finally:
        connection.close()


def _differing(model: type[models.Model], before: Rows, after: Rows) -> Iterator[Row]:
    for key in before | after:
        old, new = before.get(key), after.get(key)
        if old == new:
            continue
        if old is not None and new is not None:
            names = [name for name in new if new[name] != old[name]]
            old, new = {name: old[name] for name in names}, {name: new[name] for name in names}
        yield Row(model._meta.label, str(key), _plain(model, old), _plain(model, new))


def _plain(model: type[models.Model], row: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return a row as JSON has it."""
    if row is None:
        return None
    values = {name: value for name, value in row.items() if name != "pk"}
    return {name: value if _is_plain(value) else str(value) for name, value in values.items()}


def _is_plain(value: Any) -> bool:
    return value is None or isinstance(value, bool | int | str | list | dict)


def subjects(rows: list[Row]) -> list[str]:
    """Return the names of what a change was about: courses, groups, qualifications, robots. No names of people."""
    found: dict[str, None] = {}
    for row in rows:
        values = (row.before or {}) | (row.after or {})
        if row.table == RobotGroup._meta.label and row.after is None:
            found[values["name"]] = None
        for model, column in _NAMED.items():
            key = row.key if row.table == model._meta.label else values.get(column)
            named = model._default_manager.filter(pk=key).first() if key else None
            if named is not None:
                found[str(named)] = None
    return list(found)


_NAMED: dict[type[models.Model], str] = {
    Course: "course_id",
    Qualification: "qualification_id",
    RobotGroup: "robotgroup_id",
    Robot: "robot_id",
    Holiday: "holiday_id",
}


def may_change(person: User, rows: list[Row]) -> bool:
    """Return whether a person may change all these rows now: staff any, supervisors those of their own."""
    if person.is_staff:
        return True
    courses = list(courses_managed_by(person))
    allowed: dict[str, set[Any]] = {
        "robot_id": set(robots_managed_by(person).values_list("pk", flat=True)),
        "course_id": {one.pk for one in courses},
        "qualification_id": {one.pk for course in courses for one in demanded_in(course)},
    }
    for row in rows:
        model, column = _BY_LABEL[row.table], _SUPERVISED.get(row.table)
        values = (row.before or {}) | (row.after or {})
        if column and column not in values:  # of a changed row, only what changed is kept
            values = model._default_manager.filter(pk=row.key).values(column).first() or {}
        if column is None or _value(model, column, values.get(column)) not in allowed[column]:
            return False
    return True


# The tables that supervisors change, and the column with the robot, course or qualification that they need a right on.
_SUPERVISED = {
    Enrolment._meta.label: "course_id",
    QualificationGrant._meta.label: "qualification_id",
    Policy._meta.label: "robot_id",
    OutOfService._meta.label: "robot_id",
}


def put_back(rows: list[Row]) -> tuple[list[Row], int]:
    """Make rows as they were before a change. Return these, and how many were changed since and stay as they are."""
    made = [row for row in reversed(rows) if row.before is None]
    tried = [(row, _put_back(row)) for row in [*made, *(row for row in rows if row.before is not None)]]
    return [row for row, done in tried if done], sum(done is False for _row, done in tried)


def _put_back(row: Row) -> bool | None:
    """Return whether the row is as it was; None: it was so already."""
    model = _BY_LABEL[row.table]
    held = model._default_manager.filter(pk=row.key).first()
    if row.after is None:
        return held is None and _made_again(model, row)
    if held is None or any(not _same(held, name, value) for name, value in row.after.items()):
        return None if held is None and row.before is None else False
    if row.before is None:
        held.delete()
        return True
    for name, value in row.before.items():
        setattr(held, name, _value(model, name, value))
    held.save(update_fields=[model._meta.get_field(name).name for name in row.before])
    return True


def _made_again(model: type[models.Model], row: Row) -> bool:
    values = {name: _value(model, name, value) for name, value in (row.before or {}).items()}
    try:
        with transaction.atomic():
            model(**values).save(force_insert=True)
    except DatabaseError:  # somebody gave it again, or removed what it refers to
        return False
    return True


def _value(model: type[models.Model], name: str, value: Any) -> Any:
    column: Any = model._meta.get_field(name)
    return (column.target_field if column.is_relation else column).to_python(value)


def _same(held: models.Model, name: str, value: Any) -> bool:
    return bool(getattr(held, name) == _value(type(held), name, value))


# --- rows in the log ------------------------------------------------------------------------------

_SLUGS: dict[str, type[models.Model]] = {
    "course": Course,
    "qualification": Qualification,
    "group": RobotGroup,
    "robotgroup": RobotGroup,
    "robot": Robot,
}


def facts_of(rows: list[Row]) -> list[dict[str, Any]]:
    """Return what the log says of rows that were put back: table, slugs, key of the person, names of columns."""
    slugs = {
        name: {str(key): slug for key, slug in model._default_manager.values_list("pk", "slug")}
        for name, model in _SLUGS.items()
    }
    for row in rows:  # of entries that are gone now
        slug = ((row.before or {}) | (row.after or {})).get("slug")
        for name, model in _SLUGS.items() if slug else ():
            if row.table == model._meta.label:
                slugs[name].setdefault(row.key, slug)
    return [_facts_of(row, slugs) for row in rows]


def _facts_of(row: Row, slugs: dict[str, dict[str, str]]) -> dict[str, Any]:
    model = _BY_LABEL[row.table]
    facts: dict[str, Any] = {"entry": model._meta.model_name, "what": "changed"}
    values = (row.before or {}) | (row.after or {})
    if row.before is None or row.after is None:
        facts["what"] = "added" if row.after is None else "removed"
    else:
        facts["fields"] = sorted(values)
        values = model._default_manager.filter(pk=row.key).values().get()
    for name, known in slugs.items():
        key = row.key if _SLUGS[name] is model else values.get(f"{name}_id")
        if key is not None:
            facts[name.removeprefix("robot") or name] = known.get(str(key))
    person = row.key if model is User else values.get("person_id") or values.get("user_id")
    if person is not None:
        facts["person"] = str(person)
    return facts | ({"role": values["role"]} if values.get("role") else {})
