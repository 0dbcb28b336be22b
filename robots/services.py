"""Writing to the registry. Every change is checked, written and recorded in one transaction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from django.db import models, transaction

from fleet.audit import record
from robots.models import Robot, RobotProfile, RobotRole, Role

if TYPE_CHECKING:
    from fleet.accounts.models import User

NOT_ENTERED = {"id", "fence", "updated_at", "shipped_digest"}  # columns that people do not fill in


@transaction.atomic
def robot_save(*, robot: Robot, actor: User | None) -> Robot:
    """Create `robot`, or save what was changed in it; `ValidationError` if it is not right."""
    _save(robot, kind="robot", actor=actor, robot=robot)
    return robot


@transaction.atomic
def profile_save(*, profile: RobotProfile, actor: User | None) -> RobotProfile:
    """Create `profile`, or save what was changed in it; `ValidationError` if it is not right."""
    _save(profile, kind="profile", actor=actor, robot=None)
    return profile


def _save(entry: Robot | RobotProfile, *, kind: str, actor: User | None, robot: Robot | None) -> None:
    entry.full_clean()
    about = {"robot_id": robot.id, "robot_name": robot.name} if robot else {}
    if entry._state.adding:
        entry.save(force_insert=True)
        record(f"{kind}.create", actor=actor, parameters=_entered(entry), **about)
        return
    before = _entered(type(entry)._default_manager.select_for_update().get(pk=entry.pk))
    after = _entered(entry)
    changes = [
        {"field": field, "from": before[field], "to": value}
        for field, value in after.items()
        if value != before[field]
    ]
    if changes:
        # Only what changed: a form that was open for long must not bring back an old fencing number.
        entry.save(update_fields=[*(str(change["field"]) for change in changes), "updated_at"])
        named = {} if robot else {"profile": entry.slug}
        record(f"{kind}.change", actor=actor, parameters={**named, "changes": changes}, **about)


def _entered(entry: models.Model) -> dict[str, Any]:
    """The columns that people fill in, as JSON values."""
    return {
        field.name: field.value_from_object(entry)
        for field in entry._meta.concrete_fields
        if field.name not in NOT_ENTERED
    }


@transaction.atomic
def role_set(*, robot: Robot, user: User, role: Role | None, actor: User | None) -> None:
    """Give `user` this role on `robot`, in place of any other; None takes it away."""
    held = RobotRole.objects.select_for_update().filter(robot=robot, user=user).first()
    before = held.role if held else None
    after = role.value if role else None
    if before == after:
        return
    if role is None:
        RobotRole.objects.filter(robot=robot, user=user).delete()
    else:
        RobotRole.objects.update_or_create(robot=robot, user=user, defaults={"role": role.value})
    record(
        "role.change",
        actor=actor,
        robot_id=robot.id,
        robot_name=robot.name,
        parameters={"user": str(user.pk), "name": user.display_name, "from": before, "to": after},
    )


@transaction.atomic
def fence_next(robot: Robot, at_least: int = 0) -> int:
    """A fencing number above every one given so far, and above `at_least` (the highest the bridge has seen)."""
    given = Robot.objects.select_for_update().values_list("fence", flat=True).get(pk=robot.pk)
    fence = max(given, at_least) + 1
    Robot.objects.filter(pk=robot.pk).update(fence=fence)
    return fence
