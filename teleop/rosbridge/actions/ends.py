"""How the task of a goal ends, by the states that the bridge reports. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from robots.shared import wire
from robots.shared.wire import Limb, LimbState, TaskRequest

# Statuses of actionlib_msgs/GoalStatus, and of action_msgs/GoalStatus in ROS 2
PENDING, ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, REJECTED = range(6)
IN_ROS2 = {SUCCEEDED: 4, PREEMPTED: 5, ABORTED: 6, REJECTED: 6}

# Outcomes by status; others: `ABORTED`
_SUCCEEDED = {"succeeded", "done", "sent", "arrived"}
_PREEMPTED = {
    *("cancelled", "stopped", "control_ended", "control_lost", "link_lost", "bridge_ended"),
    *("replaced", "taken_over", "intruder"),
}


class Seen(Protocol):
    """The part of `wire.State` that tells how tasks ended."""

    @property
    def motion_ended(self) -> wire.MotionEnd | None: ...
    @property
    def speech_ended(self) -> wire.SpeechEnd | None: ...
    @property
    def going_ended(self) -> wire.GoEnd | None: ...
    @property
    def limbs(self) -> Mapping[Limb, LimbState]: ...
    @property
    def head_ended(self) -> wire.HeadEnd | None: ...


class End(NamedTuple):
    """The end of a goal: a status of actionlib, and why."""

    status: int
    text: str


def end_of(request: TaskRequest, before: Seen, now: Seen) -> End | None:
    """Return how an accepted task has ended; None: not yet. `before`: what was seen when it was requested."""
    ended: wire.MotionEnd | wire.SpeechEnd | wire.GoEnd | wire.LimbEnd | wire.HeadEnd | None = None
    match request:
        case wire.Play():
            ended = now.motion_ended if _number(now.motion_ended) != _number(before.motion_ended) else None
        case wire.Say():
            ended = now.speech_ended if _number(now.speech_ended) != _number(before.speech_ended) else None
        case wire.Go(seq=seq, fence=fence):
            last = now.going_ended
            ended = last if last and (last.seq, last.fence) == (seq, fence) else None
        case wire.MoveLimb(limb=limb, seq=seq, fence=fence):
            end = now.limbs[limb].ended if limb in now.limbs else None
            ended = end if end and (end.seq, end.fence) == (seq, fence) else None
        case wire.TurnHead(seq=seq, fence=fence):
            head = now.head_ended if now.head_ended and now.head_ended.fence == fence else None
            if head and head.seq > seq:
                return End(PREEMPTED, "replaced")
            ended = head if head and head.seq == seq else None
    return None if ended is None else End(_status(ended.outcome), ended.text or ended.outcome)


def _number(end: wire.MotionEnd | wire.SpeechEnd | None) -> int | None:
    return end.number if end else None


def _status(outcome: str) -> int:
    if outcome in _SUCCEEDED:
        return SUCCEEDED
    if outcome == "rejected":
        return REJECTED
    return PREEMPTED if outcome in _PREEMPTED else ABORTED
