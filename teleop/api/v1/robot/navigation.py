"""For programs: the robot's map, and driving to a place on it."""

from __future__ import annotations

from typing import Annotated

from django.http import HttpResponse
from drf_spectacular.utils import OpenApiParameter
from msgspec import Meta, Struct, structs
from rest_framework.response import Response

from robots.places.entries import LONGEST_NAME
from robots.places.selectors import place_of_robot
from robots.registry.models import Robot, RobotMap
from robots.shared import wire
from robots.shared.wire import Refusal
from robots.shared.wire.navigation import Coordinate, Heading, MapDigest
from teleop.api.v1.framework.operation import entry_of, reads
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.robot.control import ProgramView
from teleop.api.v1.robot.tasks import TasksBase, acts, starts

_NUMBER = OpenApiParameter(
    "number", int, description="The number of the map; the picture of another map has another address."
)
NO_MAP = Refusal(
    "not_found",
    "The server has no map of this robot yet. It reads the map while somebody has control.",
    "robot",
)
_ONE_PLACE = Refusal("invalid", "Name a place, or give x and y.", "wire")


class GoRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A place of the robot's map: by its name, or by x and y, with a heading. Metres, radians."""

    place: Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)] | None = None
    x: Coordinate | None = None
    y: Coordinate | None = None
    heading: Heading | None = None  # null: the heading of the named place, or 0
    map: MapDigest = ""  # on which x and y were chosen, as `map` of the map names it: refused on another one


class PoseRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """Where the robot is on its map: metres, radians."""

    x: Coordinate
    y: Coordinate
    heading: Heading = 0.0
    map: MapDigest = ""  # as for a goal


class MapEntry(Struct, frozen=True):
    """The robot's map. Its picture has a pixel for each cell, the first row is the upper edge.

    The origin is the lower left corner, in the frame of the map: metres, radians.
    """

    number: int
    map: str  # names it in goals; equal maps of other robots have the same name
    resolution_m: float
    width: int
    height: int
    origin_x_m: float
    origin_y_m: float
    origin_rad: float
    first_seen_at: Time
    last_seen_at: Time
    picture: str  # its address


class GoView(TasksBase):
    kind, tag = wire.GO, "control"

    @starts(
        "go",
        "Drive to a place",
        kind,
        examples={"A named place": {"place": "kitchen"}, "A place": {"x": 3.4, "y": 1.8, "heading": 1.57}},
    )
    def post(self, slug: str, body: GoRequest) -> Response:
        """The robot’s own navigation drives; the gate watches, and takes over where it would touch something. Outcomes:
        arrived, failed, held_back, cancelled, stopped, replaced by a stick, and others. Needs control. While it drives,
        ask for something at least every 10 s, such as its status."""
        robot = self.robot(slug)
        asked = _asked(robot, body)
        return self.start(robot, lambda fence, seq: structs.replace(asked, fence=fence, seq=seq))

    @acts("go_cancel", "End the drive to a place", kind)
    def delete(self, slug: str) -> None:
        """The robot stands."""
        self.cancel(slug, wire.GoCancel)


class PoseView(TasksBase):
    kind, tag = wire.SET_POSE, "control"

    @acts("pose_set", "Tell the robot where it is on its map", kind)
    def put(self, slug: str, body: PoseRequest) -> None:
        """Needs control, and a robot that stands. Localisation then looks for its exact place nearby."""
        self.send(slug, lambda fence, seq: wire.SetPose(fence, body.x, body.y, body.heading, seq, body.map))


class MapView(ProgramView):
    tag = "robots"

    @reads("map_read", "Read the robot’s map")
    def get(self, slug: str) -> MapEntry:
        """The last one that the console knows: it is read while somebody has control."""
        robot = self.robot(slug)
        found = newest_map(robot)
        return entry_of(
            MapEntry,
            found,
            number=found.pk,
            map=found.digest,
            origin_rad=found.origin_yaw,
            picture=f"/api/v1/robots/{robot.slug}/map/picture?{_NUMBER.name}={found.pk}",
        )


class MapPictureView(ProgramView):
    tag = "robots"

    @reads(
        "map_picture", "Read the picture of the robot’s map", content_type="image/png", parameters=[_NUMBER]
    )
    def get(self, slug: str) -> HttpResponse:
        """PNG: obstacles are opaque, the floor is faint, the unknown is transparent."""
        return HttpResponse(bytes(newest_map(self.robot(slug), whole=True).picture), content_type="image/png")


def _asked(robot: Robot, body: GoRequest) -> wire.Go:
    """Return the message with the goal, still without fence. Raises `NotDone` or `Problem`."""
    if body.place is not None and body.x is None and body.y is None:
        place = place_of_robot(robot.id, body.place)
        heading = place.heading_rad if body.heading is None else body.heading
        return wire.Go(0, place.x_m, place.y_m, heading, place=place.name, map=place.map_id)
    if body.place is not None or body.x is None or body.y is None:
        raise Problem(_ONE_PLACE)
    return wire.Go(0, body.x, body.y, body.heading or 0.0, map=body.map)


def newest_map(robot: Robot, *, whole: bool = False) -> RobotMap:
    """Return the robot's newest map, with its picture only if `whole`. Raises `Problem`: there is none."""
    maps = RobotMap.objects.filter(robot=robot).order_by("-pk")
    found = (maps if whole else maps.defer("picture")).first()
    if found is None:
        raise Problem(NO_MAP)
    return found
