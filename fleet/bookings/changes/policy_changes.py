"""Changes by supervisors and staff: booking policies and out-of-service periods. Each one is recorded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from typing import Any
from uuid import UUID

from django.db import transaction
from django.db.models.signals import post_save
from django.dispatch import receiver
from django.utils import timezone
from django.utils.translation import gettext as _

from fleet.accounts.models import User
from fleet.audit.integrity.canonical import NO_ROBOT
from fleet.audit.services import lock_chain, record
from fleet.bookings.losses.collecting import How, kept_of, lost
from fleet.bookings.losses.weighing import hours_watched
from fleet.bookings.messages.notifications import changed_by_another
from fleet.bookings.models import Booking, OutOfService, Policy
from fleet.bookings.rules import FAR
from fleet.bookings.selectors import SWITCHED_OFF, held_between, why_out
from fleet.bookings.services import changed, robot_locked, robots_locked, settle
from robots.access.models import RobotGroup
from robots.registry.models import Robot
from robots.registry.services import named

POLICY_FIELDS = (
    "opening",
    "shortest_min",
    "longest_min",
    "horizon_days",
    "notice_min",
    "cancel_notice_min",
    "gap_min",
    "day_min",
    "week_min",
    "at_once",
    "robots_at_once",
    "grace_min",
    "needs_approval",
    "free_time",
)


@transaction.atomic
def policy_set(
    *, robot: Robot | None = None, group: RobotGroup | None = None, values: Mapping[str, Any], actor: User
) -> Policy:
    """Set the booking policy of a robot, of a group, or of all robots. Raises `ValidationError`."""
    with _robots_locked(robot, group, timezone.now()):
        if robot is None and group is None:
            lock_chain(NO_ROBOT)  # two requests at the same time would make two policies for all robots
        stored = Policy.objects.select_for_update(of=("self",)).filter(robot=robot, group=group).first()
        policy = stored or Policy(robot=robot, group=group)
        before = {name: getattr(policy, name) for name in POLICY_FIELDS}
        for name in POLICY_FIELDS:
            setattr(policy, name, values[name])
        policy.full_clean()
        changes = [
            {"field": name, "from": before[name], "to": values[name]}
            for name in POLICY_FIELDS
            if before[name] != values[name]
        ]
        if stored is None or changes:
            policy.save()
            parameters = {"changes": changes} | ({"group": group.slug} if group else {})
            record("policy.change", actor=actor, **named(robot), parameters=parameters)
        return policy


@transaction.atomic
def policy_remove(*, robot: Robot | None = None, group: RobotGroup | None = None, actor: User) -> None:
    """Remove the policy of a robot or a group, which then follows the next policy (see `Policy`)."""
    if robot is None and group is None:
        return
    with _robots_locked(robot, group, timezone.now()):
        if Policy.objects.filter(robot=robot, group=group).delete()[0]:
            parameters = {"group": group.slug} if group else {}
            record("policy.remove", actor=actor, **named(robot), parameters=parameters)


@transaction.atomic
def out_of_service_add(
    *,
    robot: Robot,
    starts_at: datetime,
    ends_at: datetime | None,
    why: str,
    note: str,
    actor: User,
    now: datetime,
) -> tuple[OutOfService, list[Booking]]:
    """Take a robot out of service for a period; `ends_at` None: until further notice.

    Return the period and the affected bookings, without those that are over. Raises `ValidationError`.
    """
    period = OutOfService(robot=robot, starts_at=starts_at, ends_at=ends_at, why=why, note=note)
    period.full_clean()
    period.save()
    until = ends_at.isoformat() if ends_at else None
    parameters = {"period": str(period.pk), "from": starts_at.isoformat(), "to": until, "why": why}
    record("robot.out_of_service", actor=actor, **named(robot), parameters=parameters, text=note)
    _tell(robot)
    affected = list(held_between([robot], max(starts_at, now), ends_at or FAR))
    for booking in affected:
        lost(booking, How.USELESS, now, before=kept_of(booking), actor=actor, why=partial(why_out, period))
    return period, affected


@transaction.atomic
def out_of_service_end(*, period_id: UUID, actor: User, now: datetime) -> None:
    """End a period now; remove it if it has not begun. Notify the people of affected bookings."""
    robot_id = OutOfService.objects.values_list("robot_id", flat=True).get(pk=period_id)
    with robot_locked(robot_id, now):
        period = OutOfService.objects.select_related("robot").get(pk=period_id)
        if period.ends_at is not None and period.ends_at <= now:
            return  # it ended after the page was opened
        starts_at, ends_at = max(period.starts_at, now), period.ends_at or FAR
        if period.starts_at >= now:
            period.delete()
        else:
            period.ends_at = now
            period.save()
        parameters = {"period": str(period_id)}
        record("robot.back_in_service", actor=actor, **named(period.robot), parameters=parameters)
        for booking in held_between([period.robot], starts_at, ends_at):
            changed_by_another(booking, actor, lambda: _("the robot is back in service"), now)


@receiver(post_save, sender=Robot)
def _robot_changed(*, instance: Robot, created: bool, update_fields: Any, **_options: Any) -> None:
    """Notify people with bookings of a robot that was switched off.

    The bookings stay: the robot may be switched on again.
    """
    if created or "enabled" not in (update_fields or ()):  # `robot_save` lists the fields that it changes
        return
    now = timezone.now()
    for booking in held_between([instance], now, FAR) if not instance.enabled else ():
        lost(booking, How.USELESS, now, before=kept_of(booking), why=partial(str, SWITCHED_OFF))
    settle(instance, now)  # this change has locked the robot's row


def _tell(robot: Robot) -> None:
    transaction.on_commit(partial(changed.send, sender=Booking, robot_id=robot.id))


@contextmanager
def _robots_locked(robot: Robot | None, group: RobotGroup | None, now: datetime) -> Iterator[None]:
    """Lock a robot, the robots of a group, or all robots: a change of their policy may free time, or take it."""
    robots = [robot] if robot else list(group.robots.all() if group else Robot.objects.all())
    with robots_locked([one.pk for one in robots], now), hours_watched(robots, now):
        yield
