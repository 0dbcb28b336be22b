"""Tickets for the doors of programs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from msgspec import Struct
from rest_framework.response import Response

from fleet.accounts.tokens.tickets import MOST, Door, TooManyTickets, ticket_make
from robots.registry.models import Robot
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import ApiView, operation
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import Problem
from teleop.control.allowed.scopes import ACTING

_TOO_MANY = Refusal(
    "too_many",
    say("There are {most} unused tickets: use them, or wait a minute.", most=MOST),
    "account",
    {"most": MOST},
)


class TicketRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A ticket for this door."""

    door: Door


class TicketMade(Struct, frozen=True):
    """A new ticket: shown once."""

    ticket: str
    path: str  # of the door's WebSocket, with the ticket
    expires_at: Time


class TicketsView(ApiView):
    tag = "topics"

    def concerned(self, slug: str, **_asked: Any) -> Iterable[Robot]:
        return [self.robot(slug)]

    @operation(
        "tickets_make",
        "Make a ticket for a door of programs",
        scope=ACTING,
        status=201,
        refuses=(404, 409),
        answer=TicketMade,
    )
    def post(self, slug: str, body: TicketRequest) -> Response:
        """A WebSocket with the ticket in its address is signed in. A ticket lives one minute and works once. It opens
        what the token opens that asks for it, and what it opened ends with that token."""
        robot = self.robot(slug)
        try:
            text, expires_at = ticket_make(
                user=self.person, sign_in=self.sign_in, token=self.token, robot=robot.slug, door=body.door
            )
        except TooManyTickets as error:
            raise Problem(_TOO_MANY) from error
        made = TicketMade(text, f"/{body.door}/{robot.slug}?ticket={text}", expires_at)
        return Response(wire.to_builtins(made), 201, headers={"Cache-Control": "no-store"})
