"""Maps that robots share: which robots have them, their names and pictures."""

from __future__ import annotations

from typing import Annotated, Any

from django.db import transaction
from django.http import HttpResponse
from django.utils.cache import patch_cache_control
from msgspec import Meta, Struct
from rest_framework.response import Response

from robots.access.selectors import roles_of
from robots.places import selectors, services
from robots.places.entries import LONGEST_NAME
from robots.places.models import Place
from robots.places.selectors import MapOfRobots, maps_of
from robots.registry.models import Robot, RobotMap, Role
from robots.shared import wire
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import entry_of, reads
from teleop.api.v1.framework.problems import NOT_FOUND, Problem
from teleop.api.v1.framework.versions import etag_of
from teleop.api.v1.setup.base import SetupView, edits, mark_of

A_YEAR_S = 365 * 24 * 3600

_NOT_YOURS = Refusal(
    "permission_denied", "Places are changed by staff and by supervisors of a robot with this map.", "account"
)


class PlaceDetail(Struct, frozen=True):
    """A named place of a map: metres, radians."""

    number: int
    name: str
    x: float
    y: float
    heading: float


class MapDetail(Struct, frozen=True):
    """A map of the robots that you may see. Its picture has a pixel for each cell, the first row is the upper edge.

    The origin is the lower left corner, in the frame of the map: metres, radians.
    """

    # Computed from the map's content: the same for all robots with this map, different after each new
    # mapping.
    map: str
    name: str  # that people gave it; empty: none
    robots: list[str]  # slugs of those that have it now
    earlier: list[str]  # of those that had it before, and have another now
    changeable: bool  # whether you may change its name and places
    resolution_m: float
    width: int
    height: int
    origin_x_m: float
    origin_y_m: float
    origin_rad: float
    picture: str  # its address
    places: list[PlaceDetail]  # by name


class MapList(Struct, frozen=True):
    """Maps; those that most robots have now come first."""

    maps: list[MapDetail]


class MapsQuery(Struct, frozen=True):
    """Which maps."""

    robot: str | None = None  # slug


class MapName(Struct, frozen=True, forbid_unknown_fields=True):
    """The name of a map; empty: none."""

    name: Annotated[str, Meta(max_length=LONGEST_NAME)]


class MapsBase(SetupView):
    tag = "maps"

    def concerned(self, digest: str, **_asked: Any) -> list[Robot]:
        """Return all robots that share the map, also those that the person does not see."""
        self.seen_map(digest)
        return selectors.robots_with(digest)

    def seen_map(self, digest: str) -> MapOfRobots:
        """Return a map of the robots that the person may see. Raises `Problem`: not found."""
        found = selectors.map_among(self.robots(), digest)
        if found is None:
            raise Problem(NOT_FOUND)
        return found

    def changeable_map(self, digest: str) -> MapOfRobots:
        """Return a map whose name and places the person may change. Raises `Problem`."""
        found = self.seen_map(digest)
        if not selectors.may_change(self.person, [*found.robots, *found.earlier]):
            raise Problem(_NOT_YOURS)
        return found

    def described(self, found: list[MapOfRobots]) -> list[MapDetail]:
        """Return the entries of these maps, with three queries."""
        digests = [one.digest for one in found]
        names, places = selectors.names_of(digests), selectors.places_of(digests)
        roles = roles_of(self.person, {robot for one in found for robot in [*one.robots, *one.earlier]})
        changed = {robot for robot, role in roles.items() if role >= Role.SUPERVISOR}
        return [
            entry_of(
                MapDetail,
                one.drawn,
                map=one.digest,
                name=names.get(one.digest, ""),
                robots=[robot.slug for robot in one.robots],
                earlier=[robot.slug for robot in one.earlier],
                changeable=any(robot.id in changed for robot in [*one.robots, *one.earlier])
                and self.serves(selectors.robots_with(one.digest)),
                origin_rad=one.drawn.origin_yaw,
                picture=f"/api/v1/maps/{one.digest}/picture",
                places=[detail_of(place) for place in places.get(one.digest, [])],
            )
            for one in found
        ]

    def map_answer(self, found: MapOfRobots) -> Response:
        """Return the response for a map.

        Its ETag depends on the name only: here people change only the name.
        """
        [detail] = self.described([found])
        return Response(wire.to_builtins(detail), headers={"ETag": etag_of(mark_of(MapName(detail.name)))})


class MapsView(MapsBase):
    @reads("maps_list", "List maps")
    def get(self, query: MapsQuery) -> MapList:
        """Of the robots that you may see, or of one: their present maps, and earlier ones that have a name or places.
        Empty: the console has no map yet. It reads a robot’s map while somebody has control."""
        robots: list[Robot] = self.robots() if query.robot is None else [self.robot(query.robot)]
        return MapList(self.described(maps_of(robots)))


class OneMapView(MapsBase):
    @reads("maps_read", "Read a map", answer=MapDetail)
    def get(self, digest: str) -> Response:
        """With its places."""
        return self.map_answer(self.seen_map(digest))

    @edits("maps_name", "Name a map", answer=MapDetail)
    def patch(self, digest: str, body: MapName) -> Response:
        """For staff and supervisors of a robot that has it."""
        found = self.changeable_map(digest)
        with transaction.atomic():
            self.require_unchanged(MapName(services.map_hold(digest).name))
            services.map_name(digest=digest, name=body.name, actor=self.person)
        return self.map_answer(found)


class PictureView(MapsBase):
    @reads("maps_picture", "Read the picture of a map", content_type="image/png")
    def get(self, digest: str) -> HttpResponse:
        """PNG: obstacles are opaque, the floor is faint, the unknown is transparent. It never changes."""
        drawn = RobotMap.objects.get(pk=self.seen_map(digest).drawn.pk)
        answer = HttpResponse(bytes(drawn.picture), content_type="image/png")
        patch_cache_control(answer, private=True, max_age=A_YEAR_S, immutable=True)
        return answer


def detail_of(place: Place) -> PlaceDetail:
    """Return a place for the answer."""
    return PlaceDetail(place.pk, place.name, place.x_m, place.y_m, place.heading_rad)
