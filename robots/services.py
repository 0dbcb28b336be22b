"""Writing to the registry. Every change is checked, written and recorded in one transaction."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict
from uuid import UUID

from django.db import models, transaction
from django.utils import timezone

from fleet.audit import record
from robots import shipped
from robots.models import BridgeStatus, Robot, RobotProfile, RobotRole, Role

if TYPE_CHECKING:
    from fleet.accounts.models import User

log = logging.getLogger(__name__)
NOT_ENTERED = {"id", "fence", "updated_at", "shipped"}  # columns that people do not fill in


@transaction.atomic
def robot_save(*, robot: Robot, actor: User | None) -> Robot:
    """Create `robot`, or save what was changed in it; `ValidationError` if it is not right."""
    robot.full_clean()
    if robot._state.adding:
        robot.save(force_insert=True)
        record("robot.create", actor=actor, **_named(robot), parameters=_entered(robot))
    elif changes := _save_changes(robot, Robot.objects.select_for_update().get(pk=robot.pk)):
        record("robot.change", actor=actor, **_named(robot), parameters={"changes": changes})
    return robot


@transaction.atomic
def profile_save(*, profile: RobotProfile, actor: User | None) -> RobotProfile:
    """Create `profile`, or save what was changed in it; `ValidationError` if it is not right."""
    profile.full_clean()
    if profile._state.adding:
        profile.save(force_insert=True)
        record("profile.create", actor=actor, parameters=_entered(profile))
    elif changes := _save_changes(profile, RobotProfile.objects.select_for_update().get(pk=profile.pk)):
        record("profile.change", actor=actor, parameters={"profile": profile.slug, "changes": changes})
    return profile


@transaction.atomic
def profile_delete(*, profile: RobotProfile, actor: User | None) -> None:
    """Delete a profile that no robot has; `ProtectedError` if one does."""
    record("profile.delete", actor=actor, parameters=_entered(profile))
    profile.delete()


@transaction.atomic
def profile_take_shipped(*, profile: RobotProfile, actor: User | None) -> bool:
    """Give up what was edited here for what the console ships; False: nothing is shipped for this profile."""
    file = shipped.file_of(profile)
    if file is None:
        return False
    _take(profile, file, actor)
    return True


@transaction.atomic
def profiles_load_shipped(*, directory: Path = shipped.DIRECTORY) -> None:
    """Bring the profiles up to the files, without touching what was edited here."""
    for file in shipped.profile_files(directory):
        profile = RobotProfile.objects.filter(slug=file.slug).first()
        if profile is None:
            profile = RobotProfile(slug=file.slug)
            shipped.fill(profile, file)
            profile_save(profile=profile, actor=None)
        elif shipped.is_edited(profile) and shipped.differs(profile, file):
            log.warning("Profile %s was edited here; the shipped one differs and was not taken.", file.slug)
        elif profile.shipped != file.columns():
            _take(profile, file, actor=None)


def _take(profile: RobotProfile, file: shipped.ProfileFile, actor: User | None) -> None:
    """Make a stored profile what `file` says."""
    shipped.fill(profile, file)
    profile_save(profile=profile, actor=actor)
    profile.save(update_fields=["shipped"])


class _Named(TypedDict):
    robot_id: UUID
    robot_name: str


def _named(robot: Robot) -> _Named:
    return {"robot_id": robot.id, "robot_name": robot.name}


def _save_changes(entry: models.Model, stored: models.Model) -> list[dict[str, Any]]:
    """Save what differs, and only that: a form left open must not bring back an old fencing number."""
    before, after = _entered(stored), _entered(entry)
    changed = [name for name in after if after[name] != before[name]]
    if changed:
        entry.save(update_fields=[*changed, "updated_at"])
    return [{"field": name, "from": before[name], "to": after[name]} for name in changed]


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
        **_named(robot),
        parameters={"user": str(user.pk), "name": user.display_name, "from": before, "to": after},
    )


@transaction.atomic
def fence_next(robot: Robot, at_least: int = 0) -> int:
    """A number above every one given so far, and above `at_least`: the highest that the bridge has seen."""
    given = Robot.objects.select_for_update().values_list("fence", flat=True).get(pk=robot.pk)
    fence = max(given, at_least) + 1
    Robot.objects.filter(pk=robot.pk).update(fence=fence)
    return fence


def bridge_status_set(*, robot_id: UUID, state: BridgeStatus.State, detail: str, pid: int | None) -> None:
    """Keep how a bridge process fares, since now. A robot that is gone by now is no matter."""
    if Robot.objects.filter(pk=robot_id).exists():
        BridgeStatus.objects.update_or_create(
            robot_id=robot_id,
            defaults={"state": state, "detail": detail[:500], "pid": pid, "since": timezone.now()},
        )
