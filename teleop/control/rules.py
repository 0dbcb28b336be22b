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
LOST_AFTER_S = 5.0  # a page that its web process did not confirm for so long counts as lost
REQUEST_S = 120.0  # a question for control that nobody answered lapses after this


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


class LeaseState(Struct, frozen=True):
    """A lease that somebody has."""

    session: UUID  # control session
    user: UUID
    name: str
    tab: Tab
    role: Role  # of its holder when it was given
    fence: int
    term_ends_at: datetime
    seen_at: datetime  # when its page was last known to be there


class OpenRequest(Struct, frozen=True):
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


def phase(lease: LeaseState | None, now: datetime) -> Phase:
    """Where the lease is at `now`."""
    if lease is None:
        return Phase.FREE
    if lapse_reason(lease, now) is not None:
        return Phase.LAPSED
    if not lease.tab.connection or now - lease.seen_at > timedelta(seconds=LOST_AFTER_S):
        return Phase.AWAY
    return Phase.HELD


def lapse_reason(lease: LeaseState, now: datetime) -> str | None:
    """Why the lease is over by the clock: "term", "away", or None while it is not."""
    if now >= lease.term_ends_at:
        return "term"
    if now - lease.seen_at > timedelta(seconds=GRACE_S):
        return "away"
    return None


def resumable_s(lease: LeaseState, now: datetime) -> float:
    """Seconds left in which the holder's page may come back."""
    return max(0.0, GRACE_S - (now - lease.seen_at).total_seconds())


def term_end(now: datetime, term_s: float, until: datetime | None) -> datetime:
    """When a term that starts now ends: after `term_s`, earlier if the permit does."""
    end = now + timedelta(seconds=term_s)
    return end if until is None else min(end, until)


def open_requests(asks: Sequence[OpenRequest], now: datetime) -> list[OpenRequest]:
    """The questions that still wait for an answer, oldest first."""
    asked_since = now - timedelta(seconds=REQUEST_S)
    return sorted((ask for ask in asks if ask.asked_at > asked_since), key=lambda ask: ask.asked_at)


NO_LEASE = Refusal("no_lease", "You do not have control: take it first.", "lease")
_ALREADY_YOURS = Refusal("already_yours", "You have control yourself.", "lease")

# --- what is allowed --------------------------------------------------------------------------


def check_take(lease: LeaseState | None, *, user: UUID, tab: Tab, now: datetime) -> Refusal | None:
    """Take control: nobody else has it. From one's own other tab it moves here."""
    if lease is None or lapse_reason(lease, now) is not None:
        return None
    if lease.user != user:
        return _somebody_has_it(lease, now)
    return _ALREADY_YOURS if lease.tab.connection == tab.connection else None


def check_resume(lease: LeaseState | None, *, user: UUID, tab: Tab, now: datetime) -> Refusal | None:
    """Go on with a lease after a reload or a network blip: same person, same tab, same sign-in, in time."""
    if lease is None or lease.user != user or not lease.tab.is_same_tab(tab):
        return Refusal("not_holder", "This tab did not have control.", "lease")
    return _over(lease, now)


def check_renew(
    lease: LeaseState | None, *, tab: Tab, asks: Sequence[OpenRequest], now: datetime
) -> Refusal | None:
    """A fresh term: only for the holder, and not while somebody waits for a turn."""
    if (refusal := check_holder(lease, tab=tab, now=now)) is not None:
        return refusal
    if waiting := open_requests(asks, now):
        return Refusal(
            "somebody_asks",
            f"{waiting[0].name} asks for control, so this term is not extended. Hand over, or drive until it ends.",
            "lease",
            {"waiting": len(waiting)},
        )
    return None


def check_request(lease: LeaseState | None, *, user: UUID, now: datetime) -> Refusal | None:
    """OpenRequest the holder for control: somebody else has it."""
    if lease is None or lapse_reason(lease, now) is not None:
        return Refusal("free", "Nobody has control: take it.", "lease")
    if lease.user == user:
        return _ALREADY_YOURS
    return None


def check_still_open(ask: OpenRequest | None, *, now: datetime) -> Refusal | None:
    """Control is handed to somebody who asks for it, still."""
    if ask is None or not open_requests([ask], now):
        return Refusal("no_such_request", "That person no longer asks for control.", "lease")
    return None


def check_take_over(
    lease: LeaseState | None, *, user: UUID, supervises: bool, now: datetime
) -> Refusal | None:
    """Take control from its holder: supervisors of the robot and staff."""
    if not supervises:
        return Refusal(
            "role_too_low",
            "Only a supervisor of this robot, or staff, may take over. OpenRequest for control instead.",
            "account",
        )
    return check_request(lease, user=user, now=now)


def check_clear(
    lease: LeaseState | None, *, tab: Tab | None, supervises: bool, now: datetime
) -> Refusal | None:
    """Clear the stop latch: the holder, a supervisor of the robot, or staff."""
    if supervises or (tab is not None and check_holder(lease, tab=tab, now=now) is None):
        return None
    return Refusal(
        "may_not_clear",
        "Only who has control, a supervisor of this robot, or staff may clear the stop.",
        "stop",
    )


def check_holder(lease: LeaseState | None, *, tab: Tab, now: datetime) -> Refusal | None:
    """Steps for the holder's own page only."""
    if lease is None:
        return NO_LEASE
    if not lease.tab.is_same_tab(tab) or lease.tab.connection != tab.connection:
        return Refusal(
            "not_holder",
            f"{lease.name} has control, from another page.",
            "lease",
            {"holder": lease.name},
        )
    return _over(lease, now)


def _over(lease: LeaseState, now: datetime) -> Refusal | None:
    if (why := lapse_reason(lease, now)) is None:
        return None
    text = "Its term is over" if why == "term" else f"Its page was gone for more than {GRACE_S:.0f} s"
    return Refusal("lease_over", f"{text}: take control again.", "lease", {"fence": lease.fence})


def _somebody_has_it(lease: LeaseState, now: datetime) -> Refusal:
    if phase(lease, now) is Phase.AWAY:
        left_s = round(resumable_s(lease, now), 1)
        return Refusal(
            "held_away",
            f"{lease.name} has control, but the page is gone; control is free in {left_s:.0f} s.",
            "lease",
            {"holder": lease.name, "resumable_s": left_s},
        )
    left_s = round((lease.term_ends_at - now).total_seconds())
    return Refusal(
        "held",
        f"{lease.name} has control: ask for it.",
        "lease",
        {"holder": lease.name, "remaining_s": left_s},
    )
