"""Driving to a place by the robot's own navigation: requests, state, path. Places are in the frame of the map."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta, Struct

from robots.wire.base import Fence, Seq

FARTHEST_PLACE_M = 10_000.0
MOST_PATH = 200  # points of a path
Coordinate = Annotated[float, Meta(ge=-FARTHEST_PLACE_M, le=FARTHEST_PLACE_M)]  # metres
MapDigest = Annotated[str, Meta(max_length=64)]  # as the console's API names a map; empty: any
PlaceName = Annotated[str, Meta(max_length=60)]  # of a place that people named
Heading = Annotated[float, Meta(ge=-math.tau, le=math.tau)]  # radians


class Go(Struct, frozen=True, tag_field="t", tag="go"):
    """Drive to a place of the map by the robot's own navigation, which the gate watches.

    The robot must stand. `State.going` shows it, `State.going_ended` its end. `place` names a place of the map: then
    the console reads x and y from that place. `map` is the map on which the place was chosen: on another one
    the robot does not go.
    """

    fence: Fence
    x: Coordinate
    y: Coordinate
    heading: Heading
    seq: Seq = 0
    place: PlaceName = ""
    map: MapDigest = ""


class GoCancel(Struct, frozen=True, tag_field="t", tag="go_cancel"):
    """End the drive to a place: the robot stands."""

    fence: Fence
    seq: Seq = 0


class SetPose(Struct, frozen=True, tag_field="t", tag="set_pose"):
    """Tell the robot where it is on its map. Only while it stands. `map` as in `Go`."""

    fence: Fence
    x: Coordinate
    y: Coordinate
    heading: Heading
    seq: Seq = 0
    map: MapDigest = ""


class Location(Struct, frozen=True):
    """The robot's pose on its map by localisation: metres, radians.

    `problem`: why it cannot drive to a place; empty: it can.
    """

    x: float
    y: float
    heading: float
    sigma_m: float  # standard deviation along the longer axis of the ellipse
    sigma_across_m: float  # along the shorter one
    ellipse_rad: float  # direction of the longer axis
    sigma_rad: float  # of the heading
    age_s: float  # since localisation was heard
    problem: str = ""


class GoProgress(Struct, frozen=True):
    """A drive to a place, from its request. `left_m`: of the path; None: not known yet."""

    number: int | None  # of its record; None: it is being recorded
    who: str
    x: float
    y: float
    heading: float
    left_m: float | None
    since_s: float
    ending: str = ""  # why it is being cancelled
    place: str = ""


class GoEnd(Struct, frozen=True):
    """End of a drive to a place. `outcome`: docs/navigation.md lists the words, or it is a refusal's code."""

    number: int | None  # of its record, as in `GoProgress`
    seq: int  # of the request, and its fence
    fence: int
    outcome: str
    text: str
    because: str | None  # the code of the verdict, refusal or halt that ended it
    left_m: float | None


class GoPath(Struct, frozen=True, tag_field="t", tag="go_path"):
    """The path that navigation plans, thinned; empty when none is under way. At most once a second."""

    path_cm: Annotated[
        list[int], Meta(max_length=2 * MOST_PATH)
    ]  # flat [x0, y0, x1, y1, ...], frame of the map
