"""Drive a distance, or turn by an angle: one request at a time, from its record to its end.

The bridge computes the velocities itself, one for each decision of the core. They pass the rules of drive
input: lease, stop, records, gate. The request ends, for example, if the holder's client is silent, odometry
is missing, or the robot does not move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from robots.bridge.audit.records import RecordedTask, Requester
from robots.bridge.drive.approach import ARRIVED, Travelled, speed_towards
from robots.bridge.tasks.task import Activity, Cause, Context, Ending, Reaction, TaskPart
from robots.shared import wire
from robots.shared.configuration.input_filters import COMMAND_LIFE_S
from robots.shared.geometry.poses import STILL, Pose, Velocity
from robots.shared.records.record_sink import Parameters
from robots.shared.records.verdict import Verdict
from robots.shared.sentences import Sentence, say, standing_alone
from robots.shared.wire import DriveBy, Grant, Refusal

DEFAULT_SHARE = 0.4  # of the robot's speed limit, if the request names no speed
CONFIRMED_S = 2.0  # the request ends after this time without a sign of the holder's client
HELD_S = 3.0  # after this time without progress, the request ends
PROGRESS = 0.01  # m or rad: smaller changes do not count as progress
SETTLED_S = 0.3  # time of zeros before standstill counts: the last velocity may still be on its way
# If the robot still moves after this time of zeros, it does not obey: the request ends.
STANDSTILL_TIMEOUT_S = 5.0

# Outcome of the request, by the code of the halt.
_OUTCOMES = {
    "control_ended": "control_lost",
    "page_gone": "control_lost",
    "page_back": "control_lost",
    "link_lost": "control_lost",
    "odometry_missing": "no_odometry",
    "odometry_stale": "no_odometry",
    "odometry_anew": "no_odometry",
    "behind_unseen": "held_back",
}
# Causes that halt the base: their code says why the request ended.
_HALTS = {Cause.GATE, Cause.HALTED, Cause.ROBOT_GONE, Cause.STOPPED, Cause.CONTROL_ENDED}
_QUIET_CODES = frozenset({"idle", "free", "robot_limit"})  # the gate does not slow the robot down


@dataclass(eq=False)
class _Request(RecordedTask):
    order: DriveBy
    speed: float  # m/s or rad/s
    last_velocity_s: float = math.inf  # time of the last velocity
    travelled: Travelled | None = None  # None until the request starts
    last_progress: float = 0.0  # last noted progress, m or rad
    last_progress_s: float = math.inf  # time of this progress
    held: Verdict | None = None  # the last verdict since `last_progress_s` that slowed the robot down
    zero_s: float | None = None  # when the robot reached the goal: zero is sent from then on

    @property
    def turns(self) -> bool:
        return self.order.angle_rad is not None

    @property
    def goal(self) -> float:
        return (self.order.angle_rad if self.turns else self.order.distance_m) or 0.0

    @property
    def progress(self) -> float:
        """The distance or angle done so far; positive: towards the goal."""
        if self.travelled is None:
            return 0.0
        done = self.travelled.angle_rad if self.turns else self.travelled.distance_m
        return math.copysign(1.0, self.goal) * done

    @property
    def words(self) -> Sentence:
        if self.turns:
            return say("turning by {angle:.0f}°", angle=math.degrees(self.goal))
        return say("driving {distance:.2f} m", distance=self.goal)


class DrivesBy(TaskPart):
    """The request in progress, if any."""

    kinds = (wire.DRIVE_BY,)
    reactions = {
        Cause.CANCELLED: Reaction.END,
        Cause.SUPERSEDED: Reaction.HALT,
        Cause.GATE: Reaction.HALT,
        Cause.HALTED: Reaction.HALT,
        Cause.ROBOT_GONE: Reaction.HALT,
        Cause.STOPPED: Reaction.END,
        Cause.CONTROL_ENDED: Reaction.END,
        Cause.PAGE_LEFT: Reaction.DROP,
        Cause.LINK_LOST: Reaction.GO_ON,
        Cause.UNRECORDED: Reaction.END,
        Cause.BRIDGE_ENDED: Reaction.END,
    }
    no_task = Refusal("no_drive", "No drive by a distance or angle is in progress.", "robot")

    def __init__(self, context: Context) -> None:
        self._context = context
        self._limits = context.config.gate.limits
        self._gate = context.gate
        self._records = context.records
        self._request: _Request | None = None
        self._pose: Pose | None = None
        self.last: wire.DriveByEnd | None = None  # how the last request ended, for pages

    # --- rules and begin ----------------------------------------------------------------------------

    def take(self, order: DriveBy, grant: Grant, requester: Requester, now_s: float) -> None:
        refusal = self.refuse(order, grant.max_share) or self._why_not(requester, now_s)
        if refusal is not None:
            requester.answer(refusal)
            return
        speed = _speed(order) or self._speed_limit(order, min(DEFAULT_SHARE, grant.max_share))
        parameters: Parameters = (
            {"distance_m": order.distance_m, "speed_mps": round(speed, 3)}
            if order.distance_m is not None
            else {"angle_rad": order.angle_rad, "speed_radps": round(speed, 3)}
        )
        number = self._records.request(requester.holder, wire.DRIVE_BY.record, parameters, now_s)
        self._request = _Request(requester, number, now_s, order, speed)

    def _why_not(self, requester: Requester, now_s: float) -> Refusal | None:
        """Return the first rule that forbids to begin a drive. The core judges each velocity afterwards."""
        rules = self._context.rules
        return (
            rules.why_not_begin(requester, now_s)
            or self._context.tasks.blocks(Activity.DRIVE, now_s)
            or rules.why_not_still(now_s)
        )

    def refuse(self, order: DriveBy, max_share: float) -> Refusal | None:
        """Return why this request is refused: another request is in progress, or the speed is too high."""
        if self._request is not None:
            who = self._request.requester.holder.holder
            text = say(
                "The robot is {words}, requested by {who}: cancel it or wait.",
                words=self._request.words,
                who=who,
            )
            return Refusal("driving", text, "robot", {"who": who})
        most, asked = self._speed_limit(order, max_share), _speed(order)
        if asked is None or asked <= most:
            return None
        unit, name = ("m/s", "limit_mps") if order.angle_rad is None else ("rad/s", "limit_radps")
        text = say(
            "You may drive this robot with at most {most:.2f} {unit} in this direction.", most=most, unit=unit
        )
        return Refusal("too_fast", text, "robot", {name: round(most, 3)})

    def tick(self, now_s: float) -> None:
        """Start a request whose recording has finished, or refuse it: its record failed, or a rule forbids it now."""
        request = self._request
        if request is None or request.travelled is not None or not request.number.done():
            return
        if refusal := request.unrecorded or self._why_not(request.requester, now_s):
            self.deny(refusal.code, refusal, now_s)
        elif self._pose is None:  # no robot is online without odometry
            text = "The robot’s odometry has not come yet."
            self.deny("no_odometry", Refusal("robot_offline", text, "robot"), now_s)
        else:
            request.travelled = Travelled(self._pose)
            request.last_velocity_s = request.last_progress_s = now_s
            request.requester.answer(None)

    # --- while it runs ------------------------------------------------------------------------------

    @property
    def running_requester(self) -> Requester | None:
        """The requester of the request that drives the robot now."""
        request = self._request
        return request.requester if request is not None and request.travelled is not None else None

    @property
    def in_progress(self) -> bool:
        return self._request is not None

    @property
    def under_way(self) -> list[str]:
        return [self._request.words] if self._request is not None else []

    def moved(self, pose: Pose) -> None:
        """Take odometry."""
        self._pose = pose
        if self._request is not None and self._request.travelled is not None:
            self._request.travelled.moved(pose)

    def velocity(self, grant: Grant, confirmed_s: float, sent: Velocity, now_s: float) -> Velocity:
        """Return the next velocity. `sent`: the last one; `confirmed_s`: when the holder was last there."""
        request = self._request
        if request is None or request.travelled is None:
            return STILL
        passed_s, request.last_velocity_s = now_s - request.last_velocity_s, now_s
        if passed_s > COMMAND_LIFE_S:
            self.end(
                "late",
                say("This computer is overloaded: the bridge was {seconds:.1f} s late.", seconds=passed_s),
                now_s,
            )
            return STILL
        if now_s - confirmed_s > CONFIRMED_S:
            text = say(
                "Nothing came from the holder’s page or program for {seconds:.0f} s.", seconds=CONFIRMED_S
            )
            self.end("control_lost", text, now_s)
            return STILL
        left = abs(request.goal) - request.progress
        if left <= ARRIVED or request.zero_s is not None:
            self._arrive(request, now_s)
            return STILL
        turns, latency_s = request.turns, self._gate.latency.in_force_s(now_s)
        most = min(request.speed, self._speed_limit(request.order, grant.max_share))
        sign = math.copysign(1.0, request.goal)
        speed = sign * speed_towards(
            left,
            max(sign * (sent.w if turns else sent.vx), 0.0),
            most,
            min(wire.SLOWEST_RADPS if turns else wire.SLOWEST_MPS, most),
            self._limits.angular_radps2 if turns else self._limits.linear_mps2,
            latency_s,
            passed_s,
        )
        return Velocity(0.0, 0.0, speed) if turns else Velocity(speed, 0.0, 0.0)

    def decided(self, verdict: Verdict, now_s: float) -> None:
        """Take the gate's verdict on that velocity. End the request after `HELD_S` without progress."""
        request = self._request
        if request is None or request.travelled is None:
            return
        if verdict.neutral:
            self.halted(verdict.code, verdict.text, now_s)
            return
        if verdict.code not in _QUIET_CODES:
            request.held = verdict
        if request.progress - request.last_progress >= PROGRESS:
            request.last_progress, request.last_progress_s, request.held = request.progress, now_s, None
        elif now_s - request.last_progress_s > HELD_S:
            if request.held is not None:
                self.end("held_back", standing_alone(request.held.text), now_s, request.held.code)
            else:
                key = "The robot did not move for {seconds:.0f} s, although the gate did not slow it down."
                text = say(key, seconds=HELD_S)
                self.end("no_progress", text, now_s)

    def _arrive(self, request: _Request, now_s: float) -> None:
        """Send zero at the goal; the request is done when the robot stands."""
        if request.zero_s is None:
            request.zero_s = now_s
        waited_s = now_s - request.zero_s
        if waited_s >= SETTLED_S and self._gate.standstill(now_s):
            self.end("done", "", now_s)
        elif waited_s > STANDSTILL_TIMEOUT_S:
            key = "The robot still moves after {seconds:.0f} s of zero velocity."
            text = say(key, seconds=STANDSTILL_TIMEOUT_S)
            self.end("no_progress", text, now_s)

    # --- end ----------------------------------------------------------------------------------------

    def awaits(self, needed: wire.NeutralNeeded, now_s: float) -> None:
        """End the request: the robot or a sensor is silent (`needed`). At the goal only odometry counts."""
        request = self._request
        if request is not None and (request.zero_s is None or needed.code in _OUTCOMES):
            self.halted(needed.code, needed.sentence, now_s)

    def forbidden(self, refusal: Refusal, now_s: float) -> None:
        """End the request: a rule forbids motion now."""
        outcome = "control_lost" if refusal.rule == "lease" else refusal.code
        self.end(outcome, refusal.sentence, now_s, refusal.code)

    def halted(self, code: str, reason: str, now_s: float) -> None:
        """End the request: the robot was halted, or a sensor that the gate needs is silent."""
        self.end(_outcome(code), standing_alone(reason), now_s, code)

    def drop(self, ending: Ending, now_s: float) -> None:
        outcome = "control_lost" if ending.cause is Cause.CONTROL_ENDED else ending.refusal.code
        self.deny(outcome, ending.of_unbegun, now_s)

    def end_running(self, ending: Ending, now_s: float) -> None:
        code, outcome = ending.refusal.code, _outcome(ending.refusal.code)
        self.end(
            outcome, standing_alone(ending.refusal.sentence), now_s, code if ending.cause in _HALTS else None
        )

    def deny(self, outcome: str, refusal: Refusal, now_s: float) -> None:
        """Refuse a request that has not started."""
        request = self._request
        if request is not None and request.travelled is None:
            self._request = None
            request.requester.answer(refusal)
            self._record(request, outcome, refusal.sentence, now_s)

    def end(self, outcome: str, text: str, now_s: float, because: str | None = None) -> None:
        """End the request that runs, if any."""
        request = self._request
        if request is None or request.travelled is None:
            return
        self._request = None
        self.last = wire.DriveByEnd(
            number=request.number.result(),
            seq=request.order.seq,
            fence=request.order.fence,
            outcome=outcome,
            text=text,
            because=because,
            distance_m=round(request.travelled.distance_m, 3),
            angle_rad=round(request.travelled.angle_rad, 4),
        )
        self._record(request, outcome, text, now_s, because)

    def state(self, now_s: float) -> dict[str, Any]:
        return {"drive_by": self.view(now_s), "drive_by_ended": self.last}

    def headline(self, now_s: float) -> tuple[object, ...]:
        return (self.running_requester, self.last)

    def view(self, now_s: float) -> wire.DriveByProgress | None:
        """Return the request that runs, for pages."""
        request = self._request
        if request is None or request.travelled is None:
            return None
        return wire.DriveByProgress(
            number=request.number.result(),
            who=request.requester.holder.holder,
            goal_m=request.order.distance_m,
            goal_rad=request.order.angle_rad,
            distance_m=round(request.travelled.distance_m, 2),
            angle_rad=round(request.travelled.angle_rad, 2),
            since_s=round(now_s - request.since_s, 1),
        )

    def _speed_limit(self, order: DriveBy, share: float) -> float:
        """Return the speed of a full stick at this share, in the direction of `order`: m/s or rad/s."""
        limits = self._limits
        if order.angle_rad is not None:
            return limits.turn_radps * share
        forward = limits.forward_mps * share
        return forward if (order.distance_m or 0.0) >= 0.0 else min(forward, limits.reverse_mps)

    def _record(
        self, request: _Request, outcome: str, text: str, now_s: float, because: str | None = None
    ) -> None:
        travelled = request.travelled
        figures: dict[str, str | float] = {
            "distance_m": round(travelled.distance_m, 3) if travelled else 0.0,
            "angle_rad": round(travelled.angle_rad, 4) if travelled else 0.0,
            "duration_s": round(now_s - request.since_s, 2),
        }
        said = {"because": because, "text": text}
        figures |= {name: words for name, words in said.items() if words}
        self._records.outcome(request, wire.DRIVE_BY.outcome, outcome, figures, now_s)


def _speed(order: DriveBy) -> float | None:
    """Return the requested speed in m/s or rad/s, if any."""
    return order.speed_mps if order.angle_rad is None else order.speed_radps


def _outcome(code: str) -> str:
    """Return the outcome for the code of a halt or of a refusal."""
    return _OUTCOMES.get(code, "held_back" if code.startswith("scan_") else code)
