"""How control of a robot stands, as the database has it, and as one connection is told of it."""

from __future__ import annotations

from datetime import datetime
from uuid import UUID

from msgspec import Struct

from robots import wire
from robots.bridge.config import Allowed, LinkAddress
from robots.registry.models import Role
from teleop.control import rules
from teleop.control.policy import Permit
from teleop.control.rules import LeaseState, OpenRequest, Phase, Tab


class SessionEnd(Struct, frozen=True):
    """How a control session ended."""

    reason: str  # a models.EndReason
    note: str


class Rights(Struct, frozen=True):
    """What one sign-in may do with one robot now."""

    alive: bool  # signed in, account active
    role: Role | None
    permit: Permit | wire.Refusal  # to control

    @property
    def supervises(self) -> bool:
        """Whether this is a supervisor of the robot, or staff."""
        return self.role is not None and self.role >= Role.SUPERVISOR


class ControlStatus(Struct, frozen=True):
    """One robot's lease and all around it, read at one moment."""

    read_at: datetime
    lease: LeaseState | None
    asks: list[OpenRequest]
    endings: dict[UUID, SessionEnd]  # of the control sessions that were asked for and are over
    rights: dict[tuple[UUID, str], Rights]  # by (user, session key), of those who were asked for


class RobotEntry(Struct, frozen=True):
    """What the registry says of a robot."""

    refusal: wire.Refusal | None  # why nobody drives it
    facts: wire.RobotFacts
    link: LinkAddress
    allowed: tuple[Allowed, ...]


def control_message(status: ControlStatus, *, user: UUID, tab: Tab, rights: Rights) -> wire.Control:
    """Who has control, as the page in `tab` may see it."""
    now, lease = status.read_at, status.lease
    phase = rules.phase(lease, now)
    asks = rules.open_requests(status.asks, now)
    mine = lease is not None and lease.tab.connection == tab.connection
    free = lease is None or phase is Phase.LAPSED
    if lease is None or free:
        return wire.Control("free", may_clear=rights.supervises, refusal=_refusal(rights))
    return wire.Control(
        state=_state(phase, mine=mine, own=lease.user == user),
        holder=lease.name,
        fence=lease.fence if mine else None,
        session=str(lease.session) if mine else None,
        remaining_s=round((lease.term_ends_at - now).total_seconds(), 1),
        resumable_s=round(rules.resumable_s(lease, now), 1) if phase is Phase.AWAY else None,
        requests=[wire.Request(ask.id, ask.name) for ask in asks] if mine or rights.supervises else [],
        asking=next((ask.id for ask in asks if ask.tab.connection == tab.connection), None),
        may_take_over=rules.check_take_over(lease, user=user, supervises=rights.supervises, now=now) is None
        and _refusal(rights) is None,
        may_clear=mine or rights.supervises,
        refusal=_refusal(rights) or (None if mine else rules.check_take(lease, user=user, tab=tab, now=now)),
    )


def _state(phase: Phase, *, mine: bool, own: bool) -> wire.ControlState:
    if mine:
        return "yours"
    if phase is Phase.AWAY:
        return "away"
    return "elsewhere" if own else "other"


def _refusal(rights: Rights) -> wire.Refusal | None:
    return rights.permit if isinstance(rights.permit, wire.Refusal) else None


def comparable(control: wire.Control, status: ControlStatus) -> tuple[object, ...]:
    """What of `control` is news when it differs: everything but the seconds that run by themselves."""
    return (
        control.state,
        control.holder,
        control.fence,
        control.session,
        status.lease.term_ends_at if status.lease else None,
        [request.id for request in control.requests],
        control.asking,
        control.may_take_over,
        control.may_clear,
        control.refusal and control.refusal.code,
    )
