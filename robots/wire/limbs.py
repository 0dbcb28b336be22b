"""Limbs that a person moves by a single number: gripper and torso. Requests, state, facts."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from robots.wire.base import Fence, Seq

Limb = Literal["gripper", "torso"]
FARTHEST_LIMB_M = 4.0
LimbPosition = Annotated[float, Meta(ge=-FARTHEST_LIMB_M, le=FARTHEST_LIMB_M)]  # metres


class MoveLimb(Struct, frozen=True, tag_field="t", tag="move_limb"):
    """Move a limb: the gripper until its fingers are `to_m` apart, the torso to this height above its lowest place.

    The base must stand, and stands until the limb is there. The torso moves only while the arm is at home. A new
    request replaces the one of the same limb. `State.limbs` shows where it is, and its end.
    """

    fence: Fence
    limb: Limb
    to_m: LimbPosition
    seq: Seq = 0


class LimbCancel(Struct, frozen=True, tag_field="t", tag="limb_cancel"):
    """End the move of a limb: it stays where it is."""

    fence: Fence
    limb: Limb
    seq: Seq = 0


class LimbRange(Struct, frozen=True):
    """Least and largest `to_m` of a limb."""

    least_m: float
    most_m: float


class LimbEnd(Struct, frozen=True):
    """End of a move. `outcome`: docs/limbs.md lists the words, or it is a refusal's code."""

    number: int | None  # of its record; None: it has none
    seq: int  # of the request, and its fence
    fence: int
    outcome: str
    text: str
    at_m: float | None  # where it was then


class LimbState(Struct, frozen=True, omit_defaults=True):
    """A limb as joint states say, and its move for this console, from the request."""

    at_m: float | None  # None: not known
    to_m: float | None = None  # where it goes; None: it is not moved by this console
    who: str = ""
    since_s: float | None = None
    ending: str = ""  # why the move is being cancelled
    ended: LimbEnd | None = None  # the last one
