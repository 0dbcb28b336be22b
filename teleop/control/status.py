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
from teleop.control.rules import Ask, Holding, Phase, Tab


class Ending(Struct, frozen=True):
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


class Standing(Struct, frozen=True):
    """One robot's lease and all around it, read at one moment."""

    read_at: datetime
    holding: Holding | None
    asks: list[Ask]
    endings: dict[UUID, Ending]  # of the control sessions that were asked for and are over
    rights: dict[tuple[UUID, str], Rights]  # by (user, session key), of those who were asked for


class Registered(Struct, frozen=True):
    """What the registry says of a robot."""

    refusal: wire.Refusal | None  # why nobody drives it
    facts: wire.RobotFacts
    link: LinkAddress
    allowed: tuple[Allowed, ...]


def control_for(standing: Standing, *, user: UUID, tab: Tab, rights: Rights) -> wire.Control:
    """Who has control, as the page in `tab` may see it."""
    now, holding = standing.read_at, standing.holding
    phase = rules.phase(holding, now)
    asks = rules.open_asks(standing.asks, now)
    mine = holding is not None and holding.tab.connection == tab.connection
    free = holding is None or phase is Phase.LAPSED
    if holding is None or free:
        return wire.Control("free", may_clear=rights.supervises, refusal=_refusal(rights))
    return wire.Control(
        state=_state(phase, mine=mine, own=holding.user == user),
        holder=holding.name,
        fence=holding.fence if mine else None,
        session=str(holding.session) if mine else None,
        remaining_s=round((holding.term_ends_at - now).total_seconds(), 1),
        resumable_s=round(rules.resumable_s(holding, now), 1) if phase is Phase.AWAY else None,
        requests=[wire.Request(ask.id, ask.name) for ask in asks] if mine or rights.supervises else [],
        asking=next((ask.id for ask in asks if ask.tab.connection == tab.connection), None),
        may_take_over=rules.may_take_over(holding, user=user, supervises=rights.supervises, now=now) is None
        and _refusal(rights) is None,
        may_clear=mine or rights.supervises,
        refusal=_refusal(rights) or (None if mine else rules.may_take(holding, user=user, tab=tab, now=now)),
    )


def _state(phase: Phase, *, mine: bool, own: bool) -> wire.ControlState:
    if mine:
        return "yours"
    if phase is Phase.AWAY:
        return "away"
    return "elsewhere" if own else "other"


def _refusal(rights: Rights) -> wire.Refusal | None:
    return rights.permit if isinstance(rights.permit, wire.Refusal) else None


def gist(control: wire.Control, standing: Standing) -> tuple[object, ...]:
    """What of `control` is news when it differs: everything but the seconds that run by themselves."""
    return (
        control.state,
        control.holder,
        control.fence,
        control.session,
        standing.holding.term_ends_at if standing.holding else None,
        [request.id for request in control.requests],
        control.asking,
        control.may_take_over,
        control.may_clear,
        control.refusal and control.refusal.code,
    )
