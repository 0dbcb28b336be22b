"""Gripper and torso of one robot: which rules forbid a move, and what ends it.

A move has one limited goal, so it ends without drive input. The base stands during a move, as during a
motion. The torso carries the arm up and down. No sensor checks the space above and below an arm that reaches
out, so the arm must be at home. There it is within the footprint, where no obstacle can be. A robot without
an arm may always move its torso.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from robots.bridge.audit.records import Requester
from robots.bridge.gate.arm.discs import KNOWN_S
from robots.bridge.gate.words import LIMBS
from robots.bridge.limbs.limb_move import LimbMove
from robots.bridge.tasks.task import WHILE_HELD, Activity, Cause, Context, Ending, TaskPart
from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import Grant, Limb, Refusal


class Limbs(TaskPart):
    """The limbs of one robot that people can move."""

    kinds = (wire.LIMB,)
    reactions = WHILE_HELD
    excludes = frozenset({Activity.DRIVE, Activity.NAVIGATE, Activity.MOVE_ARM})
    neutral_words = {"limb_moving": say("nothing drives while gripper or torso move")}

    def __init__(self, context: Context) -> None:
        config = context.config
        self._context = context
        self._moves = {
            limb: LimbMove(limb, source, context.robot, context.records)
            for limb, source in config.topics.limbs.items()
        }
        self._has_arm = config.gate.has_arm or config.topics.arm is not None
        self._at_home_s = -math.inf

    def take(self, order: wire.MoveLimb, grant: Grant, requester: Requester, now_s: float) -> None:
        refusal = self._why_not(order.limb, order.to_m, requester, now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        self._moves[order.limb].begin(order, requester, now_s)

    def _why_not(self, limb: Limb, to_m: float, requester: Requester, now_s: float) -> Refusal | None:
        if limb not in self._moves:
            return Refusal(
                "no_limb", say("This robot has no {limb} that people can move.", limb=LIMBS[limb]), "robot"
            )
        rules = self._context.rules
        return (
            rules.why_not_begin(requester, now_s)
            or self._context.tasks.blocks(Activity.MOVE_ARM, now_s, but=self)
            or rules.why_not_still(now_s)
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
            away = Refusal("arm_away", "The robot’s arm left its home.", "robot")
            torso.deny(away, now_s)
            torso.end_running(Ending(Cause.CANCELLED, away), now_s)

    @property
    def _lost(self) -> Limb | None:
        """A limb that may still move, but its joint states have ended; None: there is no such limb."""
        return next(
            (limb for limb, move in self._moves.items() if move.is_lost and not move.in_progress), None
        )

    def blocks(self, activity: Activity, now_s: float) -> Refusal | None:
        """Return a refusal while a limb moves.

        The base may drive with a lost limb: the gate limits it to a crawl.
        """
        for limb, move in self._moves.items():
            if activity is Activity.DRIVE and move.is_lost and not move.in_progress:
                continue
            if move.in_progress:
                text = say(
                    "The robot moves its {limb}: wait until it is there, or cancel the move.",
                    limb=LIMBS[limb],
                )
                return Refusal("limb_moving", text, "robot", {"limb": limb})
            if move.may_move:
                text = say("The robot’s {limb} may still move: wait until it stands.", limb=LIMBS[limb])
                return Refusal("limb_moving", text, "robot", {"limb": limb})
        return None

    def cancel_request(self, order: wire.LimbCancel, why: str, now_s: float) -> Refusal | None:
        move = self._moves.get(order.limb)
        if move is None or not move.in_progress:
            return Refusal(
                "no_move", say("The {limb} is not moved by this console.", limb=LIMBS[order.limb]), "robot"
            )
        ending = Ending(Cause.CANCELLED, Refusal("cancelled", why, "robot"))
        move.drop(ending, now_s)
        move.end_running(ending, now_s)
        return None

    @property
    def under_way(self) -> list[str]:
        return [words for move in self._moves.values() for words in move.under_way]

    def tick(self, now_s: float) -> None:
        for limb, move in self._moves.items():
            requester, to_m = move.due, move.to_m
            if requester is not None and to_m is not None:
                refusal = self._why_not(limb, to_m, requester, now_s)
                if refusal is not None:
                    move.deny(refusal, now_s)
            move.start(now_s)
            move.tick(now_s)
        if self._arm_away(now_s) and (torso := self._moves.get("torso")) and torso.begun:
            torso.cancel("arm_away", say("The position of the robot’s arm is unknown now."))
        self._context.gate.observe_lost_limb(self._lost)

    def drop(self, ending: Ending, now_s: float) -> None:
        for move in self._moves.values():
            move.drop(ending, now_s)

    def end_running(self, ending: Ending, now_s: float) -> None:
        for move in self._moves.values():
            move.end_running(ending, now_s)

    def leave(self, ending: Ending, now_s: float) -> None:
        for move in self._moves.values():
            move.leave(ending, now_s)

    @property
    def ends(self) -> Iterable[LimbMove]:
        return self._moves.values()

    def move(self, limb: Limb) -> LimbMove:
        """Return the move of a limb, to pass it the robot's reports."""
        return self._moves[limb]

    def state(self, now_s: float) -> dict[str, Any]:
        return {"limbs": {limb: move.view(now_s) for limb, move in self._moves.items()}}

    def headline(self, now_s: float) -> tuple[object, ...]:
        return tuple((move.to_m, move.in_progress, move.last) for move in self._moves.values())
