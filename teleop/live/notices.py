"""What a page is told in words when control changes."""

from __future__ import annotations

from robots.wire import Level, Notice, Refusal
from teleop.control.rules import GRACE_S
from teleop.control.status import SessionEnd
from teleop.models import EndReason

# News: people decided it. A warning: the rules ended it, and the holder may want it back. An error: something failed.
_LEVELS: dict[EndReason, Level] = {
    EndReason.HANDED_OVER: "info",
    EndReason.MOVED: "info",
    EndReason.RELEASED: "info",
    EndReason.TAKEN_OVER: "info",
    EndReason.TERM: "warning",
    EndReason.AWAY: "warning",
    EndReason.RIGHT: "warning",
    EndReason.BRIDGE: "error",
}

_TEXTS = {
    EndReason.RELEASED: "Control was given back.",
    EndReason.MOVED: "You have control in another tab now.",
    EndReason.TERM: "Your term is over. Take control again if nobody else does.",
    EndReason.AWAY: f"Your page was out of reach for more than {GRACE_S:.0f} s, so control ended.",
}


GOES_ON_ELSEWHERE = Notice("info", "elsewhere", "Control goes on in another tab.")


def control_ended(ending: SessionEnd) -> Notice:
    """Why control ended, to the page that had it."""
    reason = EndReason(ending.reason)
    text = _TEXTS.get(reason, ending.note) or str(reason.label)
    return Notice(_LEVELS[reason], reason.value, text)


def control_ended_here(reason: EndReason, refusal: Refusal) -> Notice:
    """The same, where this page itself was told why."""
    return Notice(_LEVELS[reason], refusal.code, f"Control ended: {refusal.text}")


def access_revoked(refusal: Refusal) -> Notice:
    """To somebody who may not even look any more."""
    return Notice(_LEVELS[EndReason.RIGHT], refusal.code, refusal.text)


def request_received(name: str) -> Notice:
    """To the holder."""
    return Notice("info", "asked", f"{name} asks for control.")


def request_closed(free: bool) -> Notice:
    """To whoever asked, and did not get it."""
    if free:
        return Notice("info", "free", "The robot is free now: take control.")
    return Notice(
        "info",
        "not_handed_over",
        "Your question for control is closed; ask again if you still need the robot.",
    )
