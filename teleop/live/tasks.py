"""What a page asks of the robot besides driving: whether this person may, and the one answer that each order gets."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Protocol

from django.db import DatabaseError

from fleet import audit
from fleet.accounts.models import User
from robots import wire
from robots.bridge.config import Allowed
from robots.bridge.drive import twists
from robots.link.client import LinkRefused
from robots.registry.models import Role
from robots.wire import Accepted, LinkCancel, Refusal, Refused, TaskRequest, kind_of
from teleop.background.database import in_database
from teleop.background.tasks import run_in_background
from teleop.control.rules import NO_LEASE
from teleop.control.selectors import lease_of
from teleop.control.status import Rights
from teleop.live.robot_hub import RobotHub

log = logging.getLogger(__name__)

MAX_PENDING = 8  # orders of one page
BUSY = Refusal("busy", "Too much at once: wait for the answers.", "wire")

_NOT_YOURS = Refusal(
    "no_lease", "Only whoever has control, supervisors and staff may cancel what runs.", "lease"
)


class Page(Protocol):
    """Where orders come from."""

    hub: RobotHub
    user: User
    rights: Rights

    @property
    def fence(self) -> int | None:
        """The fencing number of its control, if it has control."""

    @property
    def role_in_control(self) -> Role | None:
        """The role in which it got control."""

    async def answer(self, answer: Accepted | Refused) -> None:
        """Tell the page what became of an order."""


class TaskSender:
    """The orders of one page. What its person may not ask for goes no further; all else the bridge judges, and does."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._under_way = 0

    async def take(self, order: TaskRequest) -> None:
        """Begin an order. Its answer comes beside: the stick never waits for it."""
        refusal = self._why_not(order) or (BUSY if self._under_way >= MAX_PENDING else None)
        if refusal is not None:
            await self._answer(order, refusal)
            return
        self._under_way += 1
        run_in_background(self._hand_on(order))

    def _why_not(self, order: TaskRequest) -> Refusal | None:
        if order.fence is None:
            return None if self._page.rights.supervises else _NOT_YOURS
        return check_fence(order.fence, self._page.fence) or self._why_not_there(order)

    def _why_not_there(self, order: TaskRequest) -> Refusal | None:
        """What the allow-list and this person's role have against where the order goes."""
        allowed, offers = self._page.hub.entry.allowed, self._page.hub.link.offers or wire.Offers()
        match order:
            case wire.Publish(type=type_) if type_ in twists.TYPES:
                return None  # the bridge passes it through the gate, as the stick, or not at all
            case wire.Publish(topic=topic, type=type_):
                needed = required_role(allowed, "publish", topic, type_)
            case wire.Choose(topic=str(topic), use=use) if not _is_default(offers, use, topic):
                needed = required_role(allowed, "choose", topic, use=use)
            case wire.Say(topic=str(topic)) if not _is_default(offers, "speech", topic):
                needed = required_role(allowed, "choose", topic, use="speech")
            case _:
                return None
        return check_role(self._page.rights, needed, topic) or self._why_not_yet(needed, topic)

    def _why_not_yet(self, needed: Role | None, topic: str) -> Refusal | None:
        """A role that rose counts from the next control on: what this one began would outlive its fall."""
        got_in = self._page.role_in_control
        if needed is None or got_in is None or got_in >= needed:
            return None
        text = (
            f"For {topic} one needs the role {needed.value}, and you took control as {got_in.value}: "
            "release it and take it again."
        )
        figures = {"name": topic, "role": needed.value, "taken_as": got_in.value}
        return Refusal("role_of_control", text, "account", figures)

    async def _hand_on(self, order: TaskRequest) -> None:
        try:
            answer = await self._asked(order)
            refusal = answer.refusal if isinstance(answer, Refused) else None
        except LinkRefused as refused:
            refusal = refused.refusal
        finally:
            self._under_way -= 1
        if refusal and refusal.code == "bridge_silent":  # the page has said so long ago
            log.warning("%s of robot %s got no answer", kind_of(order), self._page.hub.robot_id)
        else:
            await self._answer(order, refusal)

    async def _asked(self, order: TaskRequest) -> Accepted | Refused:
        if order.fence is not None:
            return await self._page.hub.link.order(order)
        cancel = LinkCancel(
            "speech" if isinstance(order, wire.SayCancel) else "motion", by=self._page.user.display_name
        )
        answer = await self._page.hub.link.cancel(cancel)
        run_in_background(in_database(_record_cancel, cancel.what, self._page.hub, self._page.user, answer))
        return answer

    async def _answer(self, order: TaskRequest, refusal: Refusal | None) -> None:
        kind = kind_of(order)
        if refusal is None:
            await self._page.answer(Accepted(kind, order.seq, order.fence))
        else:
            await self._page.answer(Refused(kind, refusal, order.seq, order.fence))


def check_fence(fence: int, held: int | None) -> Refusal | None:
    """Why what came under `fence` is not done on a connection whose control has the number `held`."""
    if held is None:
        return NO_LEASE
    if fence != held:
        figures = {"fence": fence, "yours": held}
        return Refusal("old_fence", "This command belongs to control that is over.", "lease", figures)
    return None


def _is_default(offers: wire.Offers, use: str, topic: str) -> bool:
    return use in offers.uses and offers.uses[use].topic == topic


def required_role(
    allowed: Iterable[Allowed], what: str, name: str, type_: str = "", use: str = ""
) -> Role | None:
    """The lowest role that may `what` with `name`; None: nobody may. `type_` "" asks for any type."""
    roles = [
        Role(entry.role)
        for entry in allowed
        if (entry.what, entry.name, entry.use) == (what, name, use) and type_ in ("", entry.type)
    ]
    return min(roles, default=None)


def check_role(rights: Rights, needed: Role | None, name: str) -> Refusal | None:
    """Why somebody with these rights may not use `name`, for which one needs the role `needed`."""
    if needed is None:
        text = f"{name} is not on the allow-list for this; ask the staff."
        return Refusal("not_allowed", text, "robot", {"name": name})
    if rights.role is None or rights.role < needed:
        text = f"For {name} one needs the role {needed.value}; ask the staff."
        return Refusal("role_too_low", text, "account", {"name": name, "role": needed.value})
    return None


def _record_cancel(what: str, hub: RobotHub, user: User, answer: Accepted | Refused) -> None:
    """Afterwards, as for a stop: what makes the robot stand waits for nothing."""
    try:
        held = lease_of(hub.robot_id)  # whose motion or sentence it is, as a rule
        audit.record(
            f"{what}.cancel",
            actor=user,
            robot_id=hub.robot_id,
            robot_name=hub.entry.facts.name,
            session_id=held.session if held else None,
            fence=held.fence if held else None,
            outcome=answer.refusal.code if isinstance(answer, Refused) else "accepted",
        )
    except (audit.AuditUnavailable, DatabaseError) as error:
        log.error("that %s cancelled a %s was not recorded: %s", user.pk, what, error)
