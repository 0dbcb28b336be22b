"""A holder of control who performs recorded motions, through a real bridge."""

from __future__ import annotations

import itertools
from collections.abc import Callable

from robots.shared import wire
from tests.processes import until
from tests.ros.bridge_support import Hand

PASSING = {"base_moving", "not_watched", "motion_running"}  # late data; a killed bridge's motion
TRIES = 20  # of motions that late scans interrupt on a busy machine
numbers = itertools.count(1)


def asked(hand: Hand, motion: str) -> wire.Refusal | None:
    """Send Play; return its refusal, None if accepted."""
    return hand.ask(wire.Play(1, motion, next(numbers)))


def ask(hand: Hand, motion: str) -> wire.Refusal | None:
    """Send Play, again while the cause of its refusal may pass; return its refusal, None if accepted."""
    answers: list[wire.Refusal | None] = []

    def lasts() -> bool:
        answers.append(asked(hand, motion))
        passes = answers[-1] is not None and answers[-1].code in PASSING
        if passes:
            hand.news()
        return not passes

    until(lasts, f"an answer to {motion} that lasts")
    return answers[-1]


def last_end(state: wire.State) -> int:
    """Return the number of the last reported end of a motion, 0 without one."""
    return (state.motion_ended.number or 0) if state.motion_ended else 0


def play(hand: Hand, motion: str) -> wire.State:
    """Start a motion; return the first state in which it runs."""
    assert ask(hand, motion) is None
    return hand.state_until(lambda state: state.motion and state.motion.name == motion, f"{motion} under way")


def end_of(hand: Hand, begun: wire.State) -> wire.MotionEnd:
    """Wait for the end of the motion that runs in this state."""
    state = hand.state_until(lambda state: last_end(state) > last_end(begun), "the end")
    assert state.motion_ended is not None
    return state.motion_ended


def perform(hand: Hand, motion: str, meanwhile: Callable[[], None] = lambda: None) -> wire.MotionEnd:
    """Perform a motion to its end; repeat it if late laser data interrupts it. Call `meanwhile` at each start."""
    for _ in range(TRIES):
        begun = play(hand, motion)
        meanwhile()
        ended = end_of(hand, begun)
        if ended.outcome != "not_watched":
            return ended
    raise AssertionError(ended)
