"""Decides whether a person may control a robot now, and until when. One list of rules; bookings will add a rule."""

from __future__ import annotations

from datetime import datetime
from typing import Protocol

from msgspec import Struct

from fleet.accounts.models import User
from robots.registry.models import Robot, Role
from robots.wire import Refusal

ROLE_LOWERED = Refusal("role_lowered", "Your role on this robot is lower now. Take control again.", "account")
ROBOT_DISABLED = Refusal("robot_disabled", "This robot is out of service: staff switched it off.", "robot")


def out_of_service(robot: Robot) -> Refusal | None:
    """Return why the robot cannot be driven by any person; None if it can."""
    if not robot.enabled:
        return ROBOT_DISABLED
    if robot.problems:
        text = f"This robot cannot be driven: its entry in the registry is wrong: {robot.problems}. Tell the staff."
        return Refusal("robot_misdescribed", text, "robot")
    return None


class Permit(Struct, frozen=True):
    """Permission to control. `until` None: this rule sets no end."""

    until: datetime | None = None
    max_share: float = 1.0  # share of the robot's speed limits

    def narrowed_by(self, other: Permit) -> Permit:
        """Return the narrower of both permits: the earlier end, the lower share."""
        ends = [until for until in (self.until, other.until) if until is not None]
        return Permit(until=min(ends, default=None), max_share=min(self.max_share, other.max_share))


class Rule(Protocol):
    """One condition of control: returns a permit or a refusal."""

    def __call__(self, *, user: User, robot: Robot, role: Role | None, now: datetime) -> Permit | Refusal: ...


def require_active_account(*, user: User, robot: Robot, role: Role | None, now: datetime) -> Permit | Refusal:
    """Refuse closed accounts."""
    if user.is_active:
        return Permit()
    return Refusal("account_inactive", "This account is closed; ask the staff.", "account")


def require_robot_in_service(
    *, user: User, robot: Robot, role: Role | None, now: datetime
) -> Permit | Refusal:
    """Refuse robots that are out of service, and limit the speed to the robot's own share."""
    return out_of_service(robot) or Permit(max_share=robot.max_share)


def require_role(*, user: User, robot: Robot, role: Role | None, now: datetime) -> Permit | Refusal:
    """Require the role operator or higher on this robot."""
    if role is not None and role >= Role.OPERATOR:
        return Permit()
    return Refusal(
        "role_too_low",
        f"You may watch {robot.name} but not drive it. Ask the staff for the role operator.",
        "account",
    )


RULES: tuple[Rule, ...] = (require_active_account, require_robot_in_service, require_role)


def permit_for(role: Role | None, *, user: User, robot: Robot, now: datetime) -> Permit | Refusal:
    """Return the permit that all rules agree on, or the first refusal."""
    permit = Permit()
    for rule in RULES:
        answer = rule(user=user, robot=robot, role=role, now=now)
        if isinstance(answer, Refusal):
            return answer
        permit = permit.narrowed_by(answer)
    return permit
