"""Limbs that a person moves by a single number: gripper and torso. Requests, state, facts."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct

from robots.shared.wire.base import Fence, Seq, Worded

Limb = Literal["gripper", "torso"]
FARTHEST_LIMB_M = 4.0
LimbPosition = Annotated[float, Meta(ge=-FARTHEST_LIMB_M, le=FARTHEST_LIMB_M)]  # metres


class MoveLimb(Struct, frozen=True, tag_field="t", tag="move_limb"):
    """Move a limb: the gripper until its fingers are `to_m` apart, the torso to this height above its lowest position.

    The base must stand, and cannot drive until the limb is there. The torso moves only while the arm is at home. A
    new request replaces the running request of the same limb. `State.limbs` shows the limb's position and the end.
    """

    fence: Fence
    limb: Limb
    to_m: LimbPosition
    seq: Seq = 0


class LimbCancel(Struct, frozen=True, tag_field="t", tag="limb_cancel"):
    """End the move of a limb: the limb stops where it is."""

    fence: Fence
    limb: Limb
    seq: Seq = 0


class LimbRange(Struct, frozen=True):
    """Smallest and largest `to_m` of a limb."""

    least_m: float
    most_m: float


class LimbEnd(Worded, frozen=True):
    """End of a move. `outcome`: a word of docs/limbs.md, or the code of a refusal."""

    number: int | None  # of its record; None: no record
    seq: int  # of the request, as `fence`
    fence: int
    outcome: str
    text: str
    at_m: float | None  # its position at the end


class LimbState(Worded, frozen=True, omit_defaults=True):
    """Position of a limb by joint states, and its move by this console, from the request on."""

    SENTENCES = ("ending",)

    at_m: float | None  # None: not known
    to_m: float | None = None  # goal of the move; None: this console does not move it
    who: str = ""
    since_s: float | None = None
    ending: str = ""  # reason why the move is being cancelled
    ended: LimbEnd | None = None  # the last end
