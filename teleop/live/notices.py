"""Notices in words for a page when control changes."""

from __future__ import annotations

from robots.shared.wire import Level, Notice, Refusal
from teleop.control.lease_checks import GRACE_S, OFFER_S
from teleop.control.status import SessionEnd
from teleop.models import EndReason

# info: a person ended control. warning: the rules ended it, and the holder may want it back. error: a fault.
_LEVELS: dict[EndReason, Level] = {
    EndReason.HANDED_OVER: "info",
    EndReason.MOVED: "info",
    EndReason.RELEASED: "info",
    EndReason.TAKEN_OVER: "info",
    EndReason.TERM: "warning",
    EndReason.SLOT: "warning",
    EndReason.AWAY: "warning",
    EndReason.RIGHT: "warning",
    EndReason.BRIDGE: "error",
}

_TEXTS = {
    EndReason.RELEASED: "You released control.",
    EndReason.MOVED: "You have control in another tab now.",
    EndReason.TERM: "Your term is over. You can take control again.",
    EndReason.AWAY: f"Your page was out of reach for more than {GRACE_S:.0f} s, so control ended.",
}


GOES_ON_ELSEWHERE = Notice("info", "elsewhere", "Control goes on in another tab.")


def control_ended(ending: SessionEnd) -> Notice:
    """Return the notice for the page that had control, with the reason for its end."""
    reason = EndReason(ending.reason)
    text = _TEXTS.get(reason, ending.note) or str(reason.label)
    return Notice(_LEVELS[reason], reason.value, text)


def control_ended_here(reason: EndReason, refusal: Refusal) -> Notice:
    """Return the notice for the page that had control, if a refusal ended it."""
    return Notice(_LEVELS[reason], refusal.code, f"Control ended: {refusal.text}")


def access_revoked(refusal: Refusal) -> Notice:
    """Return the notice for a person who may not see the robot any more."""
    return Notice(_LEVELS[EndReason.RIGHT], refusal.code, refusal.text)


def request_received(name: str) -> Notice:
    """Return the notice for the holder: another person waits for control."""
    return Notice("info", "asked", f"{name} asks for control.")


YOUR_TURN = Notice("warning", "your_turn", f"It is your turn: take control within {OFFER_S:.0f} s.")
LEFT_THE_LINE = Notice(
    "info", "left_the_line", "You no longer wait for control. Ask again if you still need the robot."
)
