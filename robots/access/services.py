"""Writing access. Each change is one transaction with its audit record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from django.db import transaction

from fleet.audit.command_line import SystemAccount
from fleet.audit.services import record
from robots.registry.models import Robot, RobotRole, Role

if TYPE_CHECKING:
    from fleet.accounts.models import User

    Actor = User | SystemAccount | None  # None: the console itself


@transaction.atomic
def role_set(*, robot: Robot, user: User, role: Role | None, actor: Actor) -> None:
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
        parameters={"user": str(user.pk), "from": before, "to": after},
        private={"name": user.display_name},
    )
