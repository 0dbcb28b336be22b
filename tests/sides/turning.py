"""A robot that its holder turns on the spot, and its stand when the gate ends this."""

from __future__ import annotations

from collections.abc import Callable

from robots.shared import wire
from tests.ros.bridge_support import Hand


def turn(hand: Hand, until: Callable[[wire.State], object] = lambda state: True) -> wire.State:
    """Turn, with the neutral stick that the gate asks for, until this is true."""

    def turns(state: wire.State) -> bool:
        hand.stick(0.0, 0.0 if state.neutral_needed else 0.5)
        return state.odometry is not None and state.odometry.w > 0.2 and bool(until(state))

    return hand.state_until(turns, "the robot to turn")


def stands(hand: Hand, code: str) -> wire.NeutralNeeded:
    """Wait for standstill for this reason, while the stick is still pushed; return what the page says of it."""

    def still(state: wire.State) -> bool:
        needed, moved = state.neutral_needed, state.odometry
        return needed is not None and needed.code == code and moved is not None and abs(moved.w) < 0.02

    needed = hand.state_until(still, f"standstill: {code}").neutral_needed
    assert needed is not None
    return needed
