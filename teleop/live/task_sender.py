"""Task requests of one connection: checks the person's role, sends them to the bridge, and answers each request once.

Tasks are all requests to a robot except drive input: motions, speech, publishing, head, limbs, choice of
topics, and drives by a distance or angle or to a place.
"""

from __future__ import annotations

import logging
import time
from typing import Protocol
from uuid import UUID

from django.db import DatabaseError
from msgspec import structs

from fleet.accounts.models import User
from fleet.audit import services as audit
from fleet.audit.errors import AuditUnavailable
from robots.link.client import LinkRefused
from robots.places.selectors import place_of_robot
from robots.registry.models import Role
from robots.shared import wire
from robots.shared.messages import twists
from robots.shared.messages.type_names import bare
from robots.shared.sentences import say
from robots.shared.wire import Accepted, LinkCancel, NotDone, Refusal, Refused, TaskRequest, kind_of
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.control.allowed.allow_list import ROLES, check_role, required_role
from teleop.control.allowed.lesson_tasks import check_lesson
from teleop.control.changes import database_refusal
from teleop.control.lease_checks import check_fence
from teleop.control.selectors import lease_of
from teleop.control.status import Rights
from teleop.live.consumers.message_socket import BUSY
from teleop.live.robot_hub import RobotHub

log = logging.getLogger(__name__)

MAX_PENDING = 8  # requests per connection
LATE_S = 2.0  # for reading a place: nobody expects a robot to start later

_NOT_YOURS = Refusal(
    "no_lease", "Only the person in control, supervisors and staff may cancel a running task.", "lease"
)


_CANCELLED = Refusal("cancelled", "It was cancelled before it began.", "robot")
_LATE = Refusal("database", "The server could not read the place in time. Try again.", "robot")


class TaskOwner(Protocol):
    """The connection that requests tasks."""

    hub: RobotHub
    user: User
    rights: Rights

    @property
    def fence(self) -> int | None:
        """The fence of its control; None without control."""

    @property
    def role_in_control(self) -> Role | None:
        """The role that the person had when they took control."""

    async def answer(self, answer: Accepted | Refused) -> None:
        """Send the answer to a request."""


class TaskSender:
    """The task requests of one connection. Refuses those that the person may not make; the bridge checks the others."""

    def __init__(self, owner: TaskOwner) -> None:
        self._owner = owner
        self._pending = 0
        self._goes = 0  # number of requested drives to a place and their cancels

    async def start(self, request: TaskRequest) -> None:
        """Send a request to the bridge. Its answer arrives in the background: drive input never waits for it."""
        if isinstance(request, wire.Go | wire.GoCancel):
            self._goes += 1
        refusal = self._check(request) or (BUSY if self._pending >= MAX_PENDING else None)
        if refusal is not None:
            await self._answer(request, refusal)
            return
        self._pending += 1
        run_in_background(self._forward(request))

    def _check(self, request: TaskRequest) -> Refusal | None:
        if request.fence is None:
            return None if self._owner.rights.supervises else _NOT_YOURS
        return (
            check_fence(request.fence, self._owner.fence)
            or check_lesson(self._owner.rights.tasks, request)
            or self._check_topic(request)
        )

    def _check_topic(self, request: TaskRequest) -> Refusal | None:
        """Check the request's topic against the allow-list and the person's role."""
        allowed, offers = self._owner.hub.entry.allowed, self._owner.hub.link.offers or wire.Offers()
        match request:
            case wire.Publish(type=type_) if bare(type_) in twists.TYPES:
                return None  # the bridge passes it through the gate like drive input, or refuses it
            case wire.Publish(topic=topic, type=type_):
                needed = required_role(allowed, "publish", topic, type_)
            case wire.Choose(topic=str(topic), use=use) if not _is_default(offers, use, topic):
                needed = required_role(allowed, "choose", topic, use=use)
            case wire.Say(topic=str(topic)) if not _is_default(offers, "speech", topic):
                needed = required_role(allowed, "choose", topic, use="speech")
            case _:
                return None
        return check_role(self._owner.rights, needed, topic) or self._check_role_at_take(needed, topic)

    def _check_role_at_take(self, needed: Role | None, topic: str) -> Refusal | None:
        """Require that the person had the role already when they took control.

        A role that the person got later counts after they take control again. Otherwise a task could go on
        after the person has lost this role.
        """
        role_at_take = self._owner.role_in_control
        if needed is None or role_at_take is None or role_at_take >= needed:
            return None
        text = say(
            "{topic} needs the role {role}, but you took control as {was}: release control and take it again.",
            topic=topic,
            role=ROLES[needed],
            was=ROLES[role_at_take],
        )
        figures = {"name": topic, "role": needed.value, "taken_as": role_at_take.value}
        return Refusal("role_of_control", text, "account", figures)

    async def _forward(self, request: TaskRequest) -> None:
        try:
            if isinstance(request, wire.Go) and request.place:
                request = await self._named(request)
            answer = await self._ask_bridge(request)
            refusal = answer.refusal if isinstance(answer, Refused) else None
        except (LinkRefused, NotDone) as refused:
            refusal = refused.refusal
        except DatabaseError as error:
            log.error("The place of a drive for robot %s was not read: %s", self._owner.hub.robot_id, error)
            refusal = database_refusal(error)
        finally:
            self._pending -= 1
        if refusal and refusal.code == "bridge_silent":
            log.warning("%s for robot %s got no answer.", kind_of(request), self._owner.hub.robot_id)
        await self._answer(request, refusal)

    async def _named(self, request: wire.Go) -> wire.Go:
        """Return the request with the place's coordinates.

        Raises `NotDone`, also if the request was cancelled during the read, or if the read took longer than
        `LATE_S`.
        """
        number, asked_s = self._goes, time.monotonic()
        found = await in_database(_to_place, request, self._owner.hub.robot_id)
        if self._goes != number:
            raise NotDone(_CANCELLED)
        if time.monotonic() - asked_s > LATE_S:
            raise NotDone(_LATE)
        return found

    async def _ask_bridge(self, request: TaskRequest) -> Accepted | Refused:
        if request.fence is not None:
            return await self._owner.hub.link.request_task(request)
        kind = next(kind for kind in wire.TASK_KINDS if type(request) is kind.cancel)
        cancel = LinkCancel(kind.name, by=self._owner.user.display_name)
        answer = await self._owner.hub.link.cancel(cancel)
        run_in_background(in_database(_record_cancel, cancel.what, self._owner.hub, self._owner.user, answer))
        return answer

    async def _answer(self, request: TaskRequest, refusal: Refusal | None) -> None:
        kind = kind_of(request)
        if refusal is None:
            await self._owner.answer(Accepted(kind, request.seq, request.fence))
        else:
            await self._owner.answer(Refused(kind, refusal, request.seq, request.fence))


def _is_default(offers: wire.Offers, use: str, topic: str) -> bool:
    return use in offers.uses and offers.uses[use].topic == topic


def _to_place(request: wire.Go, robot_id: UUID) -> wire.Go:
    """Return the request with the coordinates of the place that it names. Raises `NotDone`."""
    place = place_of_robot(robot_id, request.place)
    return structs.replace(request, x=place.x_m, y=place.y_m, place=place.name, map=place.map_id)


def _record_cancel(what: str, hub: RobotHub, user: User, answer: Accepted | Refused) -> None:
    """Record a cancel after it was sent, like a stop: stopping a motion must not wait for the database."""
    try:
        held = lease_of(hub.robot_id)  # usually the owner of the motion or sentence
        audit.record(
            f"{what}.cancel",
            actor=user,
            robot_id=hub.robot_id,
            robot_name=hub.entry.facts.name,
            session_id=held.session if held else None,
            fence=held.fence if held else None,
            outcome=answer.refusal.code if isinstance(answer, Refused) else "accepted",
        )
    except (AuditUnavailable, DatabaseError) as error:
        log.error("A cancel by %s of a %s was not recorded: %s", user.pk, what, error)
