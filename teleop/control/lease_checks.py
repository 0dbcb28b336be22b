"""Checks of a lease and of the people who wait for it. Pure functions: they use no clock, database or socket.

A check returns None if the step is allowed, else a refusal. The caller passes the present time as `now`.
Times are datetimes with a time zone, because several web processes check the same lease. The bridge gets
durations in seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from enum import Enum
from hashlib import sha256
from uuid import UUID

from msgspec import Struct

from robots.registry.models import Role
from robots.shared.sentences import say
from robots.shared.wire import Refusal

GRACE_S = 10.0  # a lease may be resumed for this time after its page was lost
LOST_AFTER_S = 5.0  # a page that sent nothing for this time counts as lost
OFFER_S = 30.0  # for this time only the next person in line may take control
WAITS_S = 15.0  # a person whose page sent nothing for this time has left the line


def fingerprint(session_key: str) -> str:
    """Return the digest of a sign-in session that a lease stores. It cannot be used to sign in."""
    return sha256(session_key.encode()).hexdigest()


class Tab(Struct, frozen=True):
    """The browser tab, or the program, to which a lease belongs."""

    token: str  # random, made and kept by the tab itself
    sign_in: str  # fingerprint of the sign-in session
    connection: str  # id of its present WebSocket; "" if the WebSocket is lost
    program: str = ""  # name of the token, if this is a program; "" for a tab

    def is_same_tab(self, other: Tab) -> bool:
        """Return whether both are the same tab of the same sign-in. Their connections may differ."""
        return self.token == other.token and self.sign_in == other.sign_in


class LeaseState(Struct, frozen=True):
    """A lease and its holder."""

    session: UUID  # control session
    user: UUID
    name: str
    tab: Tab
    role: Role  # role of the holder when the lease began
    fence: int
    term_ends_at: datetime
    seen_at: datetime  # time of the last message from the holder's page
    started_at: datetime  # begin of the control session


class Waiter(Struct, frozen=True):
    """A person in line for control."""

    id: int
    user: UUID
    name: str
    tab: Tab
    offer_until: datetime | None = None


class Phase(Enum):
    """The phase of a lease."""

    FREE = "free"
    HELD = "held"
    AWAY = "away"  # the holder's page is gone and may still come back
    LAPSED = "lapsed"  # its time is over, but its end is not stored yet


def phase(lease: LeaseState | None, now: datetime) -> Phase:
    """Return the phase of the lease at `now`."""
    if lease is None:
        return Phase.FREE
    if lapse_reason(lease, now) is not None:
        return Phase.LAPSED
    if not lease.tab.connection or now - lease.seen_at > timedelta(seconds=LOST_AFTER_S):
        return Phase.AWAY
    return Phase.HELD


def is_free(lease: LeaseState | None, now: datetime) -> bool:
    """Return whether nobody has control. A holder whose page was lost a moment ago still has control."""
    return lease is None or lapse_reason(lease, now) is not None


def lapse_reason(lease: LeaseState, now: datetime) -> str | None:
    """Return "term" if the term of the lease is over, "away" if its page was gone for too long, else None."""
    if now >= lease.term_ends_at:
        return "term"
    if now - lease.seen_at > timedelta(seconds=GRACE_S):
        return "away"
    return None


def resumable_s(lease: LeaseState, now: datetime) -> float:
    """Return the seconds left in which the holder's page may come back."""
    return max(0.0, GRACE_S - (now - lease.seen_at).total_seconds())


def term_end(now: datetime, term_s: float, until: datetime | None) -> datetime:
    """Return the end of a term that starts now: after `term_s`, or earlier at `until`."""
    end = now + timedelta(seconds=term_s)
    return end if until is None else min(end, until)


def offered(line: Sequence[Waiter], now: datetime) -> Waiter | None:
    """Return the person to whom control is offered now. If the clock is set back, no offer gets longer."""
    longest = now + timedelta(seconds=OFFER_S)
    return next(
        (one for one in line if one.offer_until is not None and now < one.offer_until <= longest), None
    )


NO_LEASE = Refusal("no_lease", "You do not have control: take it first.", "lease")
_ALREADY_YOURS = Refusal("already_yours", "You already have control.", "lease")

# --- checks -----------------------------------------------------------------------------------


def check_take(lease: LeaseState | None, *, user: UUID, tab: Tab, now: datetime) -> Refusal | None:
    """Check taking control: no other person may have it.

    If the same person has control in another tab, control moves to this tab.
    """
    if lease is None or lapse_reason(lease, now) is not None:
        return None
    if lease.user != user:
        return _held_by_other(lease, now)
    return _ALREADY_YOURS if lease.tab.connection == tab.connection else None


def check_resume(lease: LeaseState | None, *, user: UUID, tab: Tab, now: datetime) -> Refusal | None:
    """Check resuming a lease after a reload or a network failure.

    Only the same person, tab and sign-in may resume it, within `GRACE_S`.
    """
    if lease is None or lease.user != user or not lease.tab.is_same_tab(tab):
        return Refusal("not_holder", "This tab did not have control.", "lease")
    return _over(lease, now)


def check_renew(
    lease: LeaseState | None, *, tab: Tab, line: Sequence[Waiter], now: datetime
) -> Refusal | None:
    """Check starting a new term: only the holder may, and only while no other person waits for control."""
    if (refusal := check_holder(lease, tab=tab, now=now)) is not None:
        return refusal
    if line:
        return Refusal(
            "somebody_asks",
            say(
                "{name} waits for control, so your term is not extended. Hand over, or drive until it ends.",
                name=line[0].name,
            ),
            "lease",
            {"waiting": len(line)},
        )
    return None


def check_other_holds(lease: LeaseState | None, *, user: UUID, now: datetime) -> Refusal | None:
    """Check that another person has control."""
    if lease is None or lapse_reason(lease, now) is not None:
        return Refusal("free", "The robot is free: take control.", "lease")
    if lease.user == user:
        return _ALREADY_YOURS
    return None


def check_waits(waiter: Waiter | None) -> Refusal | None:
    """Check handing over: the person who will get control must still be in line."""
    if waiter is None:
        return Refusal("no_such_request", "The person no longer waits for control.", "lease")
    return None


def check_take_over(
    lease: LeaseState | None, *, user: UUID, supervises: bool, now: datetime
) -> Refusal | None:
    """Check taking control from its holder: only supervisors of the robot and staff may."""
    if not supervises:
        return Refusal(
            "role_too_low",
            "Only a supervisor of this robot or staff may take over. Ask for control instead.",
            "account",
        )
    return check_other_holds(lease, user=user, now=now)


def check_clear(
    lease: LeaseState | None, *, tab: Tab | None, supervises: bool, now: datetime
) -> Refusal | None:
    """Check clearing a stop: the holder, supervisors of the robot and staff may."""
    if supervises or (tab is not None and check_holder(lease, tab=tab, now=now) is None):
        return None
    return Refusal(
        "may_not_clear",
        "Only the person in control, a supervisor of this robot or staff may clear the stop.",
        "stop",
    )


def check_holder(lease: LeaseState | None, *, tab: Tab, now: datetime) -> Refusal | None:
    """Check that this connection holds the lease."""
    if lease is None:
        return NO_LEASE
    if not lease.tab.is_same_tab(tab) or lease.tab.connection != tab.connection:
        return Refusal(
            "not_holder",
            say("{name} has control, from another page.", name=lease.name),
            "lease",
            {"holder": lease.name},
        )
    return _over(lease, now)


def check_in_control(lease: LeaseState | None, *, user: UUID, now: datetime) -> Refusal | None:
    """Check that this person has control, in whichever tab or program."""
    if lease is None or lease.user != user:
        return NO_LEASE
    return _over(lease, now)


def check_fence(fence: int, held: int | None) -> Refusal | None:
    """Refuse a command if its `fence` differs from `held`, the fence of the connection's control (None: no control)."""
    if held is None:
        return NO_LEASE
    if fence != held:
        figures = {"fence": fence, "yours": held}
        return Refusal("old_fence", "This command belongs to an earlier control session.", "lease", figures)
    return None


def _over(lease: LeaseState, now: datetime) -> Refusal | None:
    if (why := lapse_reason(lease, now)) is None:
        return None
    text = (
        say("Your term is over: take control again.")
        if why == "term"
        else say("Your page was gone for more than {limit:.0f} s: take control again.", limit=GRACE_S)
    )
    return Refusal("lease_over", text, "lease", {"fence": lease.fence})


def _held_by_other(lease: LeaseState, now: datetime) -> Refusal:
    if phase(lease, now) is Phase.AWAY:
        left_s = round(resumable_s(lease, now), 1)
        return Refusal(
            "held_away",
            say(
                "{name} has control, but the page is gone; the robot is free in {seconds:.0f} s.",
                name=lease.name,
                seconds=left_s,
            ),
            "lease",
            {"holder": lease.name, "resumable_s": left_s},
        )
    left_s = round((lease.term_ends_at - now).total_seconds())
    return Refusal(
        "held",
        say("{name} has control: ask for it.", name=lease.name),
        "lease",
        {"holder": lease.name, "remaining_s": left_s},
    )
