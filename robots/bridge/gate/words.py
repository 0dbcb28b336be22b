"""Sentences for the operator: sensor, side, distance, remaining speed."""

from __future__ import annotations

import math

from robots.shared.geometry.poses import Velocity
from robots.shared.records.verdict import Side, Way
from robots.shared.sentences import Sentence, say
from robots.shared.sentences import age as age
from robots.shared.sentences import fine as fine

SIDES: tuple[Side, ...] = (
    "ahead",
    "ahead left",
    "left",
    "behind left",
    "behind",
    "behind right",
    "right",
    "ahead right",
)
_SIDES = (
    say("ahead"),
    say("ahead left"),
    say("left"),
    say("behind left"),
    say("behind"),
    say("behind right"),
    say("right"),
    say("ahead right"),
)
LIMBS = {"gripper": say("gripper"), "torso": say("torso")}
LEAST_TOLD_MPS = 0.2  # a mover's speed below is not known well enough to be said
WAYS: tuple[tuple[Way, Sentence], ...] = (
    ("forward", say("forward")),
    ("left", say("to the left")),
    ("reverse", say("in reverse")),
    ("right", say("to the right")),
)

NOT_SEEN_NOW = say(
    "no sensor sees this place now: drive away from it or turn to it; if nothing is there, press Forget what was seen"
)

FORGOTTEN = {
    "asked": say("The robot forgot what it saw before: a person asked for it."),
    "odometry_restarted": say("The robot forgot what it saw before: its odometry or its ROS was restarted."),
    "stamps_back": say("The robot forgot what it saw before: its clock was set back."),
    "jump": say("The robot forgot what it saw before: the pose of its odometry jumped."),
    "bridge_started": say("The robot forgot what it saw before: its bridge was started."),
}


def forgotten(code: str) -> Sentence:
    """Return a sentence that says why memory was dropped."""
    return FORGOTTEN[code]


def _eighth(bearing: float) -> int:
    return round(bearing / (math.pi / 4.0)) % len(SIDES)


def side(bearing: float) -> Side:
    """Return the eighth of the full circle around the robot that contains a bearing (base frame, radians)."""
    return SIDES[_eighth(bearing)]


def at_most(mps: float, why: str, way: Sentence | None = None) -> Sentence:
    """Return the words of a speed limit, and of its direction if it has one."""
    if way is None:
        return say("at most {speed:fine} m/s: {why}", speed=mps, why=why)
    return say("at most {speed:fine} m/s {way}: {why}", speed=mps, way=way, why=why)


def reason(limit: str) -> str:
    """Return the reason in the words of a speed limit."""
    return limit.figures["why"] if isinstance(limit, Sentence) else limit.partition(": ")[2]


def reduction(asked: Velocity, allowed: Velocity) -> Sentence:
    """Return the difference between asked and allowed twist: "slowed from 0.8 to 0.2 m/s"."""
    speed, allowed_speed = math.hypot(asked.vx, asked.vy), math.hypot(allowed.vx, allowed.vy)
    if speed == 0.0:
        return _slowed_turn(abs(asked.w), abs(allowed.w)) if allowed.w else say("not turning")
    if allowed_speed == 0.0 and allowed.w:
        return say("turning only ({speed:fine} m/s asked)", speed=speed)
    if allowed_speed == 0.0:
        return say("stopped ({speed:fine} m/s asked)", speed=speed)
    if fine(speed) == fine(allowed_speed):
        return say("slowed to {allowed:fine} m/s", allowed=allowed_speed)
    return say("slowed from {asked:fine} to {allowed:fine} m/s", asked=speed, allowed=allowed_speed)


def _slowed_turn(asked: float, allowed: float) -> Sentence:
    if fine(asked) == fine(allowed):
        return say("turning slowed to {allowed:fine} rad/s", allowed=allowed)
    return say("turning slowed from {asked:fine} to {allowed:fine} rad/s", asked=asked, allowed=allowed)


def obstacle(word: str, gap_m: float, bearing: float, rule: str, mps: float = 0.0) -> Sentence:
    """Return the cause in words: "laser, 0.6 m ahead left", with the rule if it is not obvious."""
    place = say(
        "{sensor}, {gap:fine} m {side}", sensor=word, gap=max(gap_m, 0.0), side=_SIDES[_eighth(bearing)]
    )
    if rule == "near_miss":
        return say("passing close, {obstacle}", obstacle=place)
    if rule != "mover":
        return place
    if mps < LEAST_TOLD_MPS:
        return say("moving, {obstacle}", obstacle=place)
    return say("moving at {speed:fine} m/s, {obstacle}", speed=mps, obstacle=place)


def way(direction: float) -> tuple[Way, Sentence]:
    """Return the way nearest to a direction of travel (base frame, radians), also in words: "in reverse"."""
    return WAYS[round(direction / (math.pi / 2.0)) % len(WAYS)]
