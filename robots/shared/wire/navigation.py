"""Drives to a place by the robot's own navigation: requests, state, path. Coordinates are in the frame of the map."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta, Struct

from robots.shared.wire.base import Fence, Seq, Worded

FARTHEST_PLACE_M = 10_000.0
MOST_PATH = 200  # points of a path
Coordinate = Annotated[float, Meta(ge=-FARTHEST_PLACE_M, le=FARTHEST_PLACE_M)]  # metres
MapDigest = Annotated[str, Meta(max_length=64)]  # the name of a map in the API; empty: any map
PlaceName = Annotated[str, Meta(max_length=60)]  # of a named place
Heading = Annotated[float, Meta(ge=-math.tau, le=math.tau)]  # radians


class Go(Struct, frozen=True, tag_field="t", tag="go"):
    """Drive to a place of the map by the robot's own navigation; the gate watches the drive.

    The robot must stand. `State.going` shows the drive, `State.going_ended` its end. `place` names a place of the
    map: then the console reads x and y from that place. `map` is the map on which the place was chosen: if the
    robot has another map, the goal is refused.
    """

    fence: Fence
    x: Coordinate
    y: Coordinate
    heading: Heading
    seq: Seq = 0
    place: PlaceName = ""
    map: MapDigest = ""


class GoCancel(Struct, frozen=True, tag_field="t", tag="go_cancel"):
    """End the drive to a place: the robot brakes and stands."""

    fence: Fence
    seq: Seq = 0


class SetPose(Struct, frozen=True, tag_field="t", tag="set_pose"):
    """Set the robot's pose on its map. The robot must stand. `map` as in `Go`."""

    fence: Fence
    x: Coordinate
    y: Coordinate
    heading: Heading
    seq: Seq = 0
    map: MapDigest = ""


class Location(Worded, frozen=True):
    """The robot's pose on its map by localisation: metres, radians.

    `problem`: the reason why the robot cannot drive to a place; empty: it can.
    """

    SENTENCES = ("problem",)

    x: float
    y: float
    heading: float
    sigma_m: float  # standard deviation along the longer axis of the ellipse
    sigma_across_m: float  # along the shorter axis
    ellipse_rad: float  # direction of the longer axis
    sigma_rad: float  # of the heading
    age_s: float  # since the last message of localisation
    problem: str = ""


class GoProgress(Worded, frozen=True):
    """A drive to a place, from its request on. `left_m`: length of the path that is left; None: not known yet."""

    SENTENCES = ("ending",)

    number: int | None  # of its record; None: not recorded yet
    who: str
    x: float
    y: float
    heading: float
    left_m: float | None
    since_s: float
    ending: str = ""  # reason why the drive is being cancelled
    place: str = ""


class GoEnd(Worded, frozen=True):
    """End of a drive to a place. `outcome`: a word of docs/navigation.md, or the code of a refusal."""

    number: int | None  # of its record, as in `GoProgress`
    seq: int  # of the request, as `fence`
    fence: int
    outcome: str
    text: str
    because: str | None  # the code of the verdict, refusal or halt that ended it
    left_m: float | None


class GoPath(Struct, frozen=True, tag_field="t", tag="go_path"):
    """The path that navigation plans, with fewer points; empty without a drive. At most once a second."""

    # Flat [x0, y0, x1, y1, ...], frame of the map
    path_cm: Annotated[list[int], Meta(max_length=2 * MOST_PATH)]
