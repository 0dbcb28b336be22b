"""The rules of control: values in, a refusal or None out.

No clock, no database, no socket: `now` is an argument. Times are aware datetimes, because several web processes
judge the same lease; the bridge is told seconds only. A rule answers None when the step is allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from enum import Enum
from hashlib import sha256
from uuid import UUID

from msgspec import Struct

from robots.registry.models import Role
from robots.wire import Refusal

GRACE_S = 10.0  # how long after its page was lost a lease may be resumed
LATE_S = 5.0  # a page that its web process did not confirm for so long counts as lost
ASK_S = 120.0  # a question for control that nobody answered lapses after this


def fingerprint(session_key: str) -> str:
    """Of a sign-in session, as a lease keeps it: nobody is signed in by that."""
    return sha256(session_key.encode()).hexdigest()


class Tab(Struct, frozen=True):
    """One browser tab as the server knows it: what a lease belongs to."""

    token: str  # random, made and kept by the tab itself
    sign_in: str  # fingerprint of the sign-in session it came with
    connection: str  # its WebSocket of now; "" when it is lost

    def is_same_tab(self, other: Tab) -> bool:
        """Whether both are the same tab of the same sign-in, on whatever connection."""
        return self.token == other.token and self.sign_in == other.sign_in


class Holding(Struct, frozen=True):
    """A lease that somebody has."""

    session: UUID  # control session
    user: UUID
    name: str
    tab: Tab
    role: Role  # of its holder when it was given
    fence: int
    term_ends_at: datetime
    seen_at: datetime  # when its page was last known to be there


class Ask(Struct, frozen=True):
    """An open question for control."""

    id: int
    user: UUID
    name: str
    tab: Tab
    asked_at: datetime


class Phase(Enum):
    """Where a lease is in its life."""

    FREE = "free"
    HELD = "held"
    AWAY = "away"  # the holder's page is gone; it may still come back
    LAPSED = "lapsed"  # over, though nobody has tidied up yet


def phase(holding: Holding | None, now: datetime) -> Phase:
    """Where the lease is at `now`."""
    if holding is None:
        return Phase.FREE
    if lapse(holding, now) is not None:
        return Phase.LAPSED
    if not holding.tab.connection or now - holding.seen_at > timedelta(seconds=LATE_S):
        return Phase.AWAY
    return Phase.HELD


def lapse(holding: Holding, now: datetime) -> str | None:
    """Why the lease is over by the clock: "term", "away", or None while it is not."""
    if now >= holding.term_ends_at:
        return "term"
    if now - holding.seen_at > timedelta(seconds=GRACE_S):
        return "away"
    return None


def resumable_s(holding: Holding, now: datetime) -> float:
    """Seconds left in which the holder's page may come back."""
    return max(0.0, GRACE_S - (now - holding.seen_at).total_seconds())


def term_end(now: datetime, term_s: float, until: datetime | None) -> datetime:
    """When a term that starts now ends: after `term_s`, earlier if the permit does."""
    end = now + timedelta(seconds=term_s)
    return end if until is None else min(end, until)


def open_asks(asks: Sequence[Ask], now: datetime) -> list[Ask]:
    """The questions that still wait for an answer, oldest first."""
    asked_since = now - timedelta(seconds=ASK_S)
    return sorted((ask for ask in asks if ask.asked_at > asked_since), key=lambda ask: ask.asked_at)


NO_LEASE = Refusal("no_lease", "You do not have control: take it first.", "lease")
_ALREADY_YOURS = Refusal("already_yours", "You have control yourself.", "lease")

# --- what is allowed --------------------------------------------------------------------------


def may_take(holding: Holding | None, *, user: UUID, tab: Tab, now: datetime) -> Refusal | None:
    """Take control: nobody else has it. From one's own other tab it moves here."""
    if holding is None or lapse(holding, now) is not None:
        return None
    if holding.user != user:
        return _somebody_has_it(holding, now)
    return _ALREADY_YOURS if holding.tab.connection == tab.connection else None


def may_resume(holding: Holding | None, *, user: UUID, tab: Tab, now: datetime) -> Refusal | None:
    """Go on with a lease after a reload or a network blip: same person, same tab, same sign-in, in time."""
    if holding is None or holding.user != user or not holding.tab.is_same_tab(tab):
        return Refusal("not_holder", "This tab did not have control.", "lease")
    return _over(holding, now)


def may_renew(holding: Holding | None, *, tab: Tab, asks: Sequence[Ask], now: datetime) -> Refusal | None:
    """A fresh term: only for the holder, and not while somebody waits for a turn."""
    if (refusal := must_hold(holding, tab=tab, now=now)) is not None:
        return refusal
    if waiting := open_asks(asks, now):
        return Refusal(
            "somebody_asks",
            f"{waiting[0].name} asks for control, so this term is not extended. Hand over, or drive until it ends.",
            "lease",
            {"waiting": len(waiting)},
        )
    return None


def may_ask(holding: Holding | None, *, user: UUID, now: datetime) -> Refusal | None:
    """Ask the holder for control: somebody else has it."""
    if holding is None or lapse(holding, now) is not None:
        return Refusal("free", "Nobody has control: take it.", "lease")
    if holding.user == user:
        return _ALREADY_YOURS
    return None


def must_ask(ask: Ask | None, *, now: datetime) -> Refusal | None:
    """Control is handed to somebody who asks for it, still."""
    if ask is None or not open_asks([ask], now):
        return Refusal("no_such_request", "That person no longer asks for control.", "lease")
    return None


def may_take_over(holding: Holding | None, *, user: UUID, supervises: bool, now: datetime) -> Refusal | None:
    """Take control from its holder: supervisors of the robot and staff."""
    if not supervises:
        return Refusal(
            "role_too_low",
            "Only a supervisor of this robot, or staff, may take over. Ask for control instead.",
            "account",
        )
    return may_ask(holding, user=user, now=now)


def may_clear(holding: Holding | None, *, tab: Tab | None, supervises: bool, now: datetime) -> Refusal | None:
    """Clear the stop latch: the holder, a supervisor of the robot, or staff."""
    if supervises or (tab is not None and must_hold(holding, tab=tab, now=now) is None):
        return None
    return Refusal(
        "may_not_clear",
        "Only who has control, a supervisor of this robot, or staff may clear the stop.",
        "stop",
    )


def must_hold(holding: Holding | None, *, tab: Tab, now: datetime) -> Refusal | None:
    """Steps for the holder's own page only."""
    if holding is None:
        return NO_LEASE
    if not holding.tab.is_same_tab(tab) or holding.tab.connection != tab.connection:
        return Refusal(
            "not_holder",
            f"{holding.name} has control, from another page.",
            "lease",
            {"holder": holding.name},
        )
    return _over(holding, now)


def _over(holding: Holding, now: datetime) -> Refusal | None:
    if (why := lapse(holding, now)) is None:
        return None
    text = "Its term is over" if why == "term" else f"Its page was gone for more than {GRACE_S:.0f} s"
    return Refusal("lease_over", f"{text}: take control again.", "lease", {"fence": holding.fence})


def _somebody_has_it(holding: Holding, now: datetime) -> Refusal:
    if phase(holding, now) is Phase.AWAY:
        left_s = round(resumable_s(holding, now), 1)
        return Refusal(
            "held_away",
            f"{holding.name} has control, but the page is gone; control is free in {left_s:.0f} s.",
            "lease",
            {"holder": holding.name, "resumable_s": left_s},
        )
    left_s = round((holding.term_ends_at - now).total_seconds())
    return Refusal(
        "held",
        f"{holding.name} has control: ask for it.",
        "lease",
        {"holder": holding.name, "remaining_s": left_s},
    )
