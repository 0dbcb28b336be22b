"""The part of the fleet that people may see now, read from the database for all fleet pages together."""

from __future__ import annotations

import logging
from collections.abc import Collection
from datetime import datetime
from uuid import UUID

from django.db import DatabaseError
from django.utils import timezone
from msgspec import Struct

from fleet.accounts.models import User
from fleet.accounts.selectors import signed_in
from fleet.bookings.lessons.present import InLine, line_of_turns
from fleet.bookings.schedule import Schedule, schedules_of
from robots.access.selectors import roles_of_each
from robots.registry.models import Robot, Role
from robots.registry.selectors import link_address, socket_path
from robots.registry.stored_robots import StoredRobots
from robots.shared.configuration.bridge_config import LinkAddress
from robots.shared.wire import Refusal
from teleop.control.rules import out_now, out_of_service
from teleop.control.selectors import SignIn

log = logging.getLogger(__name__)

FAULT = Refusal("link_fault", "The server failed to follow the robot’s bridge; it tries again.", "wire")


class FleetRobot(Struct, frozen=True):
    """A robot that somebody may see."""

    id: UUID
    slug: str
    enabled: bool
    refusal: Refusal | None  # why it cannot be driven now
    link: LinkAddress
    schedule: Schedule  # its bookings
    line: tuple[InLine, ...]  # of the lesson that runs now


class Own(Struct, frozen=True):
    """The part of a robot's card that is for one person only."""

    may_clear: bool
    mine: bool  # the present booking
    next_mine: bool  # the next booking
    out: Refusal | None  # why nobody can book it now, with times in the person's zone


class Sight(Struct, frozen=True):
    """The robots that one sign-in may see."""

    user: User
    robots: dict[UUID, Own]  # by name of the robot


def sights_of(
    people: Collection[SignIn], stored: StoredRobots
) -> tuple[list[FleetRobot], dict[SignIn, Sight]]:
    """Return the robots that any of these sign-ins may see, and what each may see. Those that ended are left out."""
    users = signed_in(people)
    roles = roles_of_each({user.id: user for user in users.values()}.values())
    stored.read()
    seen: set[UUID] = set().union(*(held or () for held in roles.values()))
    sees_all = None in roles.values()
    robots = [robot for robot in stored.robots if sees_all or robot.id in seen]
    now = timezone.now()
    schedules = schedules_of(robots, now)

    def sight(user: User) -> Sight:
        held = roles[user.id]
        return Sight(
            user,
            {
                robot.id: _own(
                    user, robot, Role.STAFF if held is None else held[robot.id], schedules[robot.id], now
                )
                for robot in robots
                if held is None or robot.id in held
            },
        )

    return [_robot(robot, schedules[robot.id]) for robot in robots], {
        person: sight(user) for person, user in users.items()
    }


def _robot(robot: Robot, schedule: Schedule) -> FleetRobot:
    """Return what pages show of a robot. A fault of one robot must not affect the others."""
    try:
        current = schedule.current
        line = line_of_turns(current.id) if current is not None and current.turn_min else ()
        refusal, link = out_of_service(robot), link_address(robot)
    except DatabaseError:
        raise
    except Exception:
        log.exception("The entry of robot %s could not be read.", robot.slug)
        schedule, line, refusal, link = Schedule(), (), FAULT, LinkAddress(unix_path=socket_path(robot.id))
    return FleetRobot(robot.id, robot.slug, robot.enabled, refusal, link, schedule, line)


def _own(user: User, robot: Robot, role: Role, schedule: Schedule, now: datetime) -> Own:
    following = next(iter(schedule.next), None)
    try:
        out = out_now(robot, schedule, user, now)
    except Exception:  # as above
        log.exception("Why robot %s is out of service was not found.", robot.slug)
        out = FAULT
    return Own(
        role >= Role.SUPERVISOR,
        schedule.current is not None and schedule.current.person == user.id,
        following is not None and following.person == user.id,
        out,
    )
