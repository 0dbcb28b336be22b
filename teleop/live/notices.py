"""Notices in words for a page when control changes."""

from __future__ import annotations

from fleet.bookings.schedule import CALL_S
from robots.shared.sentences import say
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
    EndReason.RELEASED: say("You released control."),
    EndReason.MOVED: say("You have control in another tab now."),
    EndReason.TERM: say("Your term is over. You can take control again."),
    EndReason.AWAY: say(
        "Your page was out of reach for more than {limit:.0f} s, so control ended.", limit=GRACE_S
    ),
}
GOES_ON_ELSEWHERE = Notice("info", "elsewhere", "Control goes on in another tab.")


def control_ended(ending: SessionEnd) -> Notice:
    """Return the notice for the page that had control, with the reason for its end."""
    reason = EndReason(ending.reason)
    text = _TEXTS.get(reason) or ending.note or str(reason.label)
    return Notice(_LEVELS[reason], reason.value, text)


def control_ended_here(reason: EndReason, refusal: Refusal) -> Notice:
    """Return the notice for the page that had control, if a refusal ended it."""
    return Notice(_LEVELS[reason], refusal.code, say("Control ended: {text}", text=refusal.sentence))


def access_revoked(refusal: Refusal) -> Notice:
    """Return the notice for a person who may not see the robot any more."""
    return Notice(_LEVELS[EndReason.RIGHT], refusal.code, refusal.sentence)


def request_received(name: str) -> Notice:
    """Return the notice for the holder: another person waits for control."""
    return Notice("info", "asked", say("{name} asks for control.", name=name))


YOUR_TURN = Notice(
    "warning", "your_turn", say("It is your turn: take control within {seconds:.0f} s.", seconds=OFFER_S)
)
CALLED = Notice(
    "warning", "your_turn", say("It is your turn: take control within {seconds:.0f} s.", seconds=CALL_S)
)
LEFT_THE_LINE = Notice(
    "info", "left_the_line", "You no longer wait for control. Ask again if you still need the robot."
)
