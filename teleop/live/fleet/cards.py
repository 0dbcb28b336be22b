"""The card of one robot, for all fleet pages of this process. Made again with each report, encoded when it is new.

A card is new when anything changes that a page shows. Figures are rounded as pages show them, so that a robot at rest
has no news; ages do not count, because pages compute times from them.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from datetime import datetime
from typing import Any
from uuid import UUID

from django.utils import timezone
from msgspec import UNSET, structs

from robots.link.client import BridgeLink, Listener, links
from robots.shared import wire
from robots.shared.wire import Booked, FleetCard, FleetSpeed, FleetState, Refusal, State
from teleop.control.status import booked_slots, turn_of
from teleop.live.fleet.sights import FAULT, FleetRobot, Own

log = logging.getLogger(__name__)

_SILENT = Refusal(
    "bridge_silent", "The robot’s bridge does not answer: it or its computer is busy or frozen.", "robot"
)
_NOBODY = UUID(int=0)
_UNSEEN_S = 2  # pages say of a robot that is silent for longer, when it was seen last
_MINUTE_S = 60.0  # pages show times of bookings in minutes


class RobotCard(Listener):
    """One robot's card. `changed` is called when it is new, with True if people want to see that at once."""

    def __init__(self, robot: FleetRobot, changed: Callable[[bool], None]) -> None:
        self.robot = robot
        self.version = 0
        self.link: BridgeLink = links.get(robot.id, robot.link)
        self._changed = changed
        self._card = FleetCard(None)
        self._key: Any = None
        self._urgent: Any = None
        self._encoded: dict[Any, bytes] = {}
        self.link.subscribe(self)
        self.look()

    def follow(self, robot: FleetRobot) -> None:
        """Follow the robot's entry and bookings, which were read again."""
        self.robot = robot
        link = links.get(robot.id, robot.link)
        if link is not self.link:
            self.link.unsubscribe(self)
            self.link = link
            self.link.subscribe(self)
        self.look()

    def close(self) -> None:
        self.link.unsubscribe(self)

    def look(self) -> None:
        """Make the card again: time has passed, or something was reported."""
        try:
            card = self._made()
            key, urgent = _shown(card), self._urgent_now()
        except Exception:  # a fault of one robot must not affect the others
            log.exception("The card of robot %s was not made.", self.robot.slug)
            card, key, urgent = FleetCard(None, FAULT), FAULT, None  # an old card would look fresh
        self._card = card
        self._encoded.clear()
        if key != self._key:
            is_urgent = urgent != self._urgent
            self._key, self._urgent = key, urgent
            self.version += 1
            self._changed(is_urgent)

    def encoded(self, own: Own) -> bytes:
        """Return the card as one person may see it."""
        key = (own.may_clear, own.mine, own.next_mine, own.out and own.out.text)
        if (found := self._encoded.get(key)) is None:
            card = structs.replace(
                self._card,
                may_clear=own.may_clear,
                booked=_of(self._card.booked, own.mine),
                next_booked=_of(self._card.next_booked, own.next_mine),
                out=own.out,
            )
            found = self._encoded[key] = wire.encode(card)
        return found

    def _made(self) -> FleetCard:
        link, robot = self.link, self.robot
        known = link.up and not link.silent
        refusal = None if known else robot.refusal or link.refusal or _SILENT
        state = fleet_state(link.state) if known and link.state else None
        now = timezone.now()
        booked, following = booked_slots(robot.schedule, _NOBODY, now)
        if booked and robot.schedule.current:
            booked = structs.replace(booked, turn=turn_of(robot.schedule.current, robot.line, now))
        return FleetCard(
            state,
            refusal,
            link.seen_at,
            pending=link.pending,
            booked=booked,
            next_booked=following,
            free_in_s=_free_in_s(robot, now),
        )

    def _urgent_now(self) -> object:
        """Return the values whose change people want to see at once."""
        link, state = self.link, self.link.state
        return (
            link.up,
            link.silent,
            link.pending,
            state and (state.phase, _is_silent(state), state.holder, state.stop, state.verdict.code),
        )

    # --- events of the link (robots.link.client.Listener) --------------------------------------------------

    def on_status(self, state: State) -> None:
        self.look()

    def on_link(self, up: bool, refusal: Refusal | None) -> None:
        self.look()


def _free_in_s(robot: FleetRobot, now: datetime) -> float | None:
    free_from = robot.schedule.free_from(now) if robot.enabled else None
    return None if free_from is None else round((free_from - now).total_seconds(), 1)


def _is_silent(state: State) -> bool:
    return state.unseen_s is not None and state.unseen_s >= wire.SILENT_S


def _of(booked: Booked | None, mine: bool) -> Booked | None:
    return structs.replace(booked, mine=True) if booked and mine else booked


def fleet_state(state: State) -> FleetState:
    """Return what fleet pages show of a state."""
    speed, place, going = state.odometry, state.location, state.going
    said = {name: parts for name, parts in (state.said or {}).items() if name in FleetState.SENTENCES}
    return FleetState(
        said=said or UNSET,
        phase=state.phase,
        text=state.text,
        stop=state.stop,
        verdict=structs.replace(state.verdict, limits=[], point=None, bearing_rad=None),
        odometry=FleetSpeed(round(speed.vx, 2), round(speed.vy, 2), round(speed.w, 2)) if speed else None,
        battery_percent=state.battery_percent and round(state.battery_percent),
        charging=state.charging,
        holder=state.holder,
        battery_left_min=state.battery_left_min,
        unseen_s=state.unseen_s,
        watchdog_missing=state.watchdog_missing,
        health=state.health,
        stands=state.stands,
        moves_although_stopped=state.moves_although_stopped,
        location=place
        and structs.replace(
            place,
            x=round(place.x, 2),
            y=round(place.y, 2),
            heading=round(place.heading, 2),
            sigma_m=0.0,
            sigma_across_m=0.0,
            ellipse_rad=0.0,
            sigma_rad=0.0,
            age_s=0.0,
        ),
        motion=state.motion,
        speech=state.speech,
        drive_by=state.drive_by,
        going=going and structs.replace(going, left_m=None),
        limbs={name: limb for name, limb in state.limbs.items() if limb.to_m is not None},
        recorded_by=state.recording.by if state.recording and state.recording.left_s > 0 else None,
    )


def _shown(card: FleetCard) -> object:
    """Return what pages show of a card, without ages: cards with the same value look the same."""
    state = card.state and _without_ages(card.state)
    return (
        state,
        card.refusal,
        card.seen_at if card.state is None else None,
        card.pending,
        _in_minutes(card.booked),
        _in_minutes(card.next_booked),
        _minutes(card.free_in_s),
    )


def _without_ages(state: FleetState) -> FleetState:
    health, moves, limbs = state.health, state.moves_although_stopped, state.limbs
    ageless = {
        "motion": state.motion,
        "speech": state.speech,
        "drive_by": state.drive_by,
        "going": state.going,
    }
    return structs.replace(
        state,
        unseen_s=_unseen(state),
        health=health
        and structs.replace(health, parts=[structs.replace(part, since_s=0) for part in health.parts]),
        moves_although_stopped=moves and structs.replace(moves, since_s=0.0),
        limbs={name: structs.replace(limb, since_s=0.0) for name, limb in limbs.items()},
        **{name: task and structs.replace(task, since_s=0.0) for name, task in ageless.items()},
    )


def _unseen(state: FleetState) -> float | None:
    """Return for how many whole seconds the robot is silent, as far as pages count them."""
    unseen_s = state.unseen_s
    if unseen_s is None or unseen_s < wire.SILENT_S:
        return unseen_s and 0.0
    whole_s = 1 + math.floor(unseen_s)
    return whole_s if state.phase == "online" else min(whole_s, 1 + _UNSEEN_S)


def _in_minutes(booked: Booked | None) -> object:
    turn = booked and booked.turn
    return booked and (
        booked.name,
        _minutes(booked.seconds),
        turn and (turn.person, turn.driving, turn.next, _minutes(turn.seconds)),
    )


def _minutes(seconds: float | None) -> int | None:
    return None if seconds is None else math.ceil(seconds / _MINUTE_S)
