"""Sharing and deleting layouts. Each change is recorded in the same transaction."""

from __future__ import annotations

from django.db import transaction

from fleet.accounts.layouts import Layout
from fleet.accounts.models import User
from fleet.audit.services import record
from fleet.base.names import require
from robots.access.selectors import supervises
from robots.registry.models import Robot
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.models import SharedLayout

MOST = 20  # of one robot: the page lists them all


@transaction.atomic
def layout_share(*, robot: Robot, name: str, layout: Layout, actor: User) -> SharedLayout:
    """Share a layout. Raises `NotDone`, or `ValidationError` about the name."""
    _require_supervisor(robot, actor)
    require(name)
    Robot.objects.select_for_update(no_key=True).get(pk=robot.pk)  # two people at once
    if robot.layouts.filter(name__iexact=name).exists():
        raise NotDone(Refusal("name_taken", "This robot has a layout of this name already.", "account"))
    if robot.layouts.count() >= MOST:
        text = say("A robot has at most {most} layouts: delete one first.", most=MOST)
        raise NotDone(Refusal("too_many", text, "account"))
    facts = {field: getattr(layout, field) for field in Layout.__struct_fields__}
    shared = SharedLayout.objects.create(robot=robot, name=name, **facts)
    _record("layout.share", shared, actor)
    return shared


@transaction.atomic
def layout_delete(*, layout: SharedLayout, actor: User) -> None:
    """Delete a shared layout. People who chose it keep it. Raises `NotDone`."""
    _require_supervisor(layout.robot, actor)
    _record("layout.delete", layout, actor)
    layout.delete()


def _require_supervisor(robot: Robot, actor: User) -> None:
    if not supervises(actor, robot):
        text = "Layouts are shared and deleted by supervisors of the robot and staff."
        raise NotDone(Refusal("permission_denied", text, "account"))


def _record(kind: str, layout: SharedLayout, actor: User) -> None:
    facts = {field: getattr(layout, field) for field in ("name", *Layout.__struct_fields__)}
    record(kind, actor=actor, robot_id=layout.robot.id, robot_name=layout.robot.name, parameters=facts)
