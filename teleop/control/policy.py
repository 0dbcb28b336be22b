"""May this person control this robot now, and until when? One list of rules; bookings become one more."""

from __future__ import annotations

from datetime import datetime
from typing import Protocol

from msgspec import Struct

from fleet.accounts.models import User
from robots.registry.models import Robot, Role
from robots.wire import Refusal

ROLE_LOWERED = Refusal(
    "role_lowered", "Your role on this robot is a lower one now; take control again.", "account"
)
ROBOT_DISABLED = Refusal("robot_disabled", "This robot is out of service: staff switched it off.", "robot")


def out_of_service(robot: Robot) -> Refusal | None:
    """Why nobody drives this robot, whoever they are."""
    if not robot.enabled:
        return ROBOT_DISABLED
    if robot.problems:
        text = (
            f"Nobody drives this robot, for its entry in the registry is wrong: {robot.problems}. Tell staff."
        )
        return Refusal("robot_misdescribed", text, "robot")
    return None


class Permit(Struct, frozen=True):
    """Leave to control. `until` None: as far as this rule goes, for any time."""

    until: datetime | None = None
    max_share: float = 1.0  # of the robot's limits

    def narrowed_by(self, other: Permit) -> Permit:
        """Both permits at once."""
        ends = [until for until in (self.until, other.until) if until is not None]
        return Permit(until=min(ends, default=None), max_share=min(self.max_share, other.max_share))


class Rule(Protocol):
    """One condition of control."""

    def __call__(self, *, user: User, robot: Robot, role: Role | None, now: datetime) -> Permit | Refusal: ...


def account_is_active(*, user: User, robot: Robot, role: Role | None, now: datetime) -> Permit | Refusal:
    """Closed accounts control nothing."""
    if user.is_active:
        return Permit()
    return Refusal("account_inactive", "This account is closed; ask the staff.", "account")


def robot_is_in_service(*, user: User, robot: Robot, role: Role | None, now: datetime) -> Permit | Refusal:
    """A robot that is out of service is not driven by anybody, and no robot above its own share of speed."""
    return out_of_service(robot) or Permit(max_share=robot.max_share)


def role_suffices(*, user: User, robot: Robot, role: Role | None, now: datetime) -> Permit | Refusal:
    """Control needs the role operator or more on this robot."""
    if role is not None and role >= Role.OPERATOR:
        return Permit()
    return Refusal(
        "role_too_low",
        f"You may watch {robot.name} but not drive it; ask the staff for the role operator.",
        "account",
    )


RULES: tuple[Rule, ...] = (account_is_active, robot_is_in_service, role_suffices)


def permitted_as(role: Role | None, *, user: User, robot: Robot, now: datetime) -> Permit | Refusal:
    """What all rules leave of the right to control, or the first refusal."""
    permit = Permit()
    for rule in RULES:
        answer = rule(user=user, robot=robot, role=role, now=now)
        if isinstance(answer, Refusal):
            return answer
        permit = permit.narrowed_by(answer)
    return permit
