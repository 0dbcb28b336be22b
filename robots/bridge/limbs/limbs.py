"""Gripper and torso of one robot: which rules forbid a move, and what ends it.

A move has one limited goal, so it ends without drive input. The base stands during a move, as during a
motion. The torso carries the arm up and down. No sensor checks the space above and below an arm that reaches
out, so the arm must be at home. There it is within the footprint, where no obstacle can be. A robot without
an arm may always move its torso.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from robots import wire
from robots.bridge.audit.records import Records, Requester
from robots.bridge.config import BridgeConfig
from robots.bridge.gate.geometry.arm_discs import KNOWN_S
from robots.bridge.limbs.limb_move import LimbMove, LimbMover
from robots.wire import Limb, MoveLimb, Refusal

WhyNot = Callable[[Requester, float], Refusal | None]


class Limbs:
    """The limbs of one robot that people can move."""

    def __init__(self, config: BridgeConfig, mover: LimbMover, records: Records) -> None:
        self._moves = {
            limb: LimbMove(limb, source, mover, records) for limb, source in config.topics.limbs.items()
        }
        self._has_arm = config.gate.has_arm or config.topics.arm is not None
        self._at_home_s = -math.inf

    def take(self, order: MoveLimb, requester: Requester, why_not: WhyNot, now_s: float) -> None:
        """Begin a move, or answer with a refusal. `why_not` checks the rules of all tasks."""
        refusal = self._why_not(order.limb, order.to_m, requester, why_not, now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        self._moves[order.limb].begin(order, requester, now_s)

    def _why_not(
        self, limb: Limb, to_m: float, requester: Requester, why_not: WhyNot, now_s: float
    ) -> Refusal | None:
        if limb not in self._moves:
            return Refusal("no_limb", f"This robot has no {limb} that people can move.", "robot")
        return (
            why_not(requester, now_s)
            or (self._arm_away(now_s) if limb == "torso" else None)
            or self._moves[limb].refuse(to_m, now_s)
        )

    def _arm_away(self, now_s: float) -> Refusal | None:
        if not self._has_arm or now_s - self._at_home_s <= KNOWN_S:
            return None
        text = "Bring the arm home first: the torso carries it, and no sensor checks the space above and below it."
        return Refusal("arm_away", text, "robot")

    def arm(self, at_home: bool, now_s: float) -> None:
        """Note whether the arm is at home. If it is not, end a move of the torso."""
        if at_home:
            self._at_home_s = now_s
        elif torso := self._moves.get("torso"):
            torso.halt(Refusal("arm_away", "The robot’s arm left its home.", "robot"), now_s)

    @property
    def lost(self) -> Limb | None:
        """A limb that may still move, but its joint states have ended; None: there is no such limb."""
        return next((limb for limb, move in self._moves.items() if move.is_lost and not move.runs), None)

    def busy(self, *, crawls: bool = False) -> Refusal | None:
        """Return why the base must stand and no motion may begin: a limb moves.

        `crawls`: ignore a lost limb. The base may drive with it, because the gate limits the base to a crawl.
        """
        for limb, move in self._moves.items():
            if crawls and move.is_lost and not move.runs:
                continue
            if move.runs:
                text = f"The robot moves its {limb}: wait until it is there, or cancel the move."
                return Refusal("limb_moving", text, "robot", {"limb": limb})
            if move.may_move:
                text = f"The robot’s {limb} may still move: wait until it stands."
                return Refusal("limb_moving", text, "robot", {"limb": limb})
        return None

    def cancel(self, limb: Limb) -> Refusal | None:
        """Cancel a move for the holder."""
        if limb in self._moves and self._moves[limb].cancel("cancelled", "Its holder cancelled it."):
            return None
        return Refusal("no_move", f"The {limb} is not moved by this console.", "robot")

    @property
    def under_way(self) -> list[str]:
        """Moves in progress, in words."""
        return [words for move in self._moves.values() for words in move.under_way]

    def tick(self, why_not: WhyNot, now_s: float) -> None:
        """Send moves whose record is written; check moves in progress."""
        for limb, move in self._moves.items():
            requester, to_m = move.due, move.to_m
            if requester is not None and to_m is not None:
                refusal = self._why_not(limb, to_m, requester, why_not, now_s)
                if refusal is not None:
                    move.deny(refusal, now_s)
            move.start(now_s)
            move.tick(now_s)
        if self._arm_away(now_s) and (torso := self._moves.get("torso")) and torso.begun:
            torso.cancel("arm_away", "The position of the robot’s arm is unknown now.")

    def end(self, refusal: Refusal, now_s: float) -> None:
        """Cancel moves that run, and drop moves that have not begun."""
        for move in self._moves.values():
            move.halt(refusal, now_s)

    def deny(self, refusal: Refusal, now_s: float) -> None:
        """Drop moves that have not begun: their page is gone."""
        for move in self._moves.values():
            move.deny(refusal, now_s)

    def close(self, refusal: Refusal, now_s: float) -> None:
        """End all moves: the bridge ends."""
        for move in self._moves.values():
            move.close(refusal, now_s)

    @property
    def moves(self) -> Iterable[LimbMove]:
        """The moves of all limbs."""
        return self._moves.values()

    def move(self, limb: Limb) -> LimbMove:
        """Return the move of a limb, to pass it the robot's reports."""
        return self._moves[limb]

    def view(self, now_s: float) -> dict[Limb, wire.LimbState]:
        """Return the limbs for pages."""
        return {limb: move.view(now_s) for limb, move in self._moves.items()}

    @property
    def headline(self) -> tuple[object, ...]:
        """The part of the state whose changes are reported at once."""
        return tuple((move.to_m, move.runs, move.last) for move in self._moves.values())
