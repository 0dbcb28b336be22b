"""Recordings that people ask for on a robot's page."""

from __future__ import annotations

from typing import Protocol

from fleet.accounts.models import User
from robots.link.client import LinkRefused
from robots.shared.wire import (
    Accepted,
    NotDone,
    RecordingRequest,
    Refusal,
    Refused,
    kind_of,
)
from teleop.background.database import in_database
from teleop.background.jobs import run_in_background
from teleop.control.status import Rights
from teleop.live.consumers.message_socket import BUSY
from teleop.live.robot_hub import RobotHub
from teleop.recordings.orders.requests import NamedRobot, ask_on_record, record_outcome

MOST_PENDING = 2  # requests per connection


class RecordingOwner(Protocol):
    """The connection that asks for recordings."""

    hub: RobotHub
    user: User
    rights: Rights

    async def answer(self, answer: Accepted | Refused) -> None:
        """Send the answer to a request."""


class RecordingSender:
    """The requests of one connection. Each is answered once, in the background: a recorder takes seconds to start."""

    def __init__(self, owner: RecordingOwner) -> None:
        self._owner = owner
        self._pending = 0

    async def start(self, request: RecordingRequest) -> None:
        """Carry out a request."""
        if self._pending >= MOST_PENDING:
            await self._answer(request, BUSY)
            return
        self._pending += 1
        run_in_background(self._carry_out(request))

    async def _carry_out(self, request: RecordingRequest) -> None:
        owner, asked, refusal = self._owner, None, None
        try:
            robot = NamedRobot(owner.hub.robot_id, owner.hub.entry.facts.name)
            asked = await in_database(ask_on_record, request, robot, owner.user, owner.rights.supervises)
            answer = await owner.hub.link.ask_recorder(asked.order)
            refusal = answer.refusal if isinstance(answer, Refused) else None
        except (LinkRefused, NotDone) as refused:
            refusal = refused.refusal
        finally:
            self._pending -= 1
        if asked is not None:
            run_in_background(in_database(record_outcome, asked.begun, owner.user, refusal))
        await self._answer(request, refusal)

    async def _answer(self, request: RecordingRequest, refusal: Refusal | None) -> None:
        kind = kind_of(request)
        await self._owner.answer(
            Refused(kind, refusal, request.seq) if refusal else Accepted(kind, request.seq)
        )
