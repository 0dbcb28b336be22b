"""Changes that may take time from people, by API: refused with the list of losses until the client confirms them."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from uuid import UUID

from django.http import HttpResponseBase
from drf_spectacular.utils import OpenApiParameter
from msgspec import Struct
from rest_framework.request import Request

from fleet.accounts.models import User
from fleet.bookings.losses.collecting import How, Loss
from fleet.bookings.losses.weighing import Seen, weigh
from robots.shared.sentences import counted
from robots.shared.wire import Refusal
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import Problem, ProblemDetails


class Confirm(Enum):
    """The answer of a client about losses."""

    YES = "yes"
    KEEP_CLOSED = "keep_closed"


PARAMETERS = (
    OpenApiParameter(
        "confirm",
        {"type": "string", "enum": [one.value for one in Confirm]},
        description="Do it although it takes time from people. `keep_closed`: their bookings outside of new opening "
        "hours stay.",
    ),
    OpenApiParameter(
        "preview",
        {"type": "string", "enum": ["yes"]},
        description="Do nothing: answer 409 with the losses, also if there are none.",
    ),
)


class LossEntry(Struct, frozen=True):
    """A booking of which a person loses something."""

    booking: UUID
    robot: str
    person: str
    username: str
    starts_at: Time
    ends_at: Time
    how: str  # cancelled, ended, shortened; turn: skipped in its line; useless, closed: the booking stays
    why: str


class LossesProblem(ProblemDetails, frozen=True, kw_only=True):
    """Why a change is not done. With the code `takes_time` or `preview`, `losses` says who loses what."""

    losses: list[LossEntry] = []


def weighed(request: Request, person: User, work: Callable[[], HttpResponseBase]) -> HttpResponseBase:
    """Do `work` if it takes no time from people, or the client confirms that. Raises `Problem`."""
    only_try = request.query_params.get("preview") is not None
    confirmed = request.query_params.get("confirm")
    seen = Seen(None, confirmed == Confirm.KEEP_CLOSED.value) if confirmed else None
    found = weigh(work, actor=person, seen=seen, only_try=only_try)
    if found.done:
        return found.answer
    losses = [_entry(one) for one in found.losses]
    refusal = _PREVIEW if only_try else _takes_time(len({one.person.pk for one in found.losses}))
    raise Problem(refusal, 409, extensions={"losses": losses})


_PREVIEW = Refusal("preview", "Nothing is done: this is the preview that you asked for.", "booking")


def _takes_time(people: int) -> Refusal:
    text = counted(
        "This takes time from {count} person: look at the losses, then send it again with confirm=yes.",
        "This takes time from {count} people: look at the losses, then send it again with confirm=yes.",
        count=people,
    )
    return Refusal("takes_time", text, "booking", {"people": people})


def _entry(loss: Loss) -> LossEntry:
    booking = loss.booking
    ends_at = loss.before["ends_at"]
    who = loss.person
    return LossEntry(
        booking.pk,
        booking.robot.slug,
        who.display_name,
        who.username,
        booking.starts_at,
        ends_at,
        How(loss.how).value,
        loss.why(),
    )
