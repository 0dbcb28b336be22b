"""Reading maps that robots share, their places, and where a robot can stand."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING
from uuid import UUID

from django.db.models import Exists, Max, OuterRef, Q
from msgspec import Struct

from robots.access.selectors import roles_of
from robots.places.entries import key_of
from robots.places.models import Place, SharedMap
from robots.registry.configuration import robot_config
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Robot, RobotMap, Role
from robots.shared.geometry.footprint import footprint_of
from robots.shared.geometry.poses import Pose
from robots.shared.maps.goal_map import GoalMap
from robots.shared.records.record_sink import TakenMap
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal

if TYPE_CHECKING:
    from fleet.accounts.models import User

USED = ~Q(name="") | Exists(Place.objects.filter(map=OuterRef("pk")))  # maps with a name or places
NO_PICTURE = Refusal(
    "no_map", "The console has no picture of this map any more, so no place can be added.", "robot"
)
NO_OUTLINE = Refusal(
    "no_outline",
    "The entries of all robots with this map are wrong: correct one; the console needs a robot’s outline.",
    "robot",
)


class MapOfRobots(Struct, frozen=True):
    """A map, the robots that have it now, and the robots that had it before. Both only of the caller's robots."""

    drawn: RobotMap  # without its picture
    robots: list[Robot]
    earlier: list[Robot]

    @property
    def digest(self) -> str:
        """Return the identity of the map: the hash of its content."""
        return self.drawn.digest


def maps_of(robots: Iterable[Robot]) -> list[MapOfRobots]:
    """Return the current maps of these robots, and their earlier maps that have places or a name.

    Maps of more robots come first; the robots of a map are sorted by name. Makes three queries.
    """
    by_id = {robot.id: robot for robot in sorted(robots, key=lambda robot: robot.name)}
    present = newest_maps(by_id)
    kept = SharedMap.objects.filter(USED).values("digest")
    before = RobotMap.objects.filter(robot__in=by_id, digest__in=kept).defer("picture").order_by("-pk")
    drawn: dict[str, RobotMap] = {}
    for one in [*present.values(), *before]:
        drawn.setdefault(one.digest, one)
    had = {(one.robot_id, one.digest) for one in before}
    found = []
    for digest, one in drawn.items():
        now = [robot for key, robot in by_id.items() if key in present and present[key].digest == digest]
        earlier = [robot for key, robot in by_id.items() if (key, digest) in had and robot not in now]
        found.append(MapOfRobots(one, now, earlier))
    return sorted(found, key=lambda one: (-len(one.robots), -one.drawn.pk))


def map_among(robots: Iterable[Robot], digest: str) -> MapOfRobots | None:
    """Return a map of these robots; None if they do not have it."""
    return next((one for one in maps_of(robots) if one.digest == digest), None)


def newest_maps(robots: Iterable[UUID]) -> dict[UUID, RobotMap]:
    """Return the newest map of each robot that has one, without its picture. Makes one query."""
    newest = RobotMap.objects.filter(robot__in=list(robots)).values("robot").annotate(newest=Max("pk"))
    found = RobotMap.objects.filter(pk__in=newest.values("newest")).defer("picture")
    return {one.robot_id: one for one in found}


def robots_with(digest: str) -> list[Robot]:
    """Return all robots that have or had this map. They share its name and places."""
    return list(Robot.objects.filter(maps__digest=digest).distinct())


def may_change(user: User, robots: Sequence[Robot]) -> bool:
    """Return whether a person supervises one of these robots, and so may change the places of their map."""
    return any(role >= Role.SUPERVISOR for role in roles_of(user, robots).values())


def names_of(digests: Iterable[str]) -> dict[str, str]:
    """Return the names of these maps, by digest; maps without a name are left out."""
    return dict(
        SharedMap.objects.filter(digest__in=list(digests)).exclude(name="").values_list("digest", "name")
    )


def places_of(digests: Iterable[str]) -> dict[str, list[Place]]:
    """Return the places of these maps, by digest and sorted by name. Makes one query."""
    found: dict[str, list[Place]] = {}
    for place in Place.objects.filter(map__in=list(digests)):
        found.setdefault(place.map_id, []).append(place)
    return found


def place_of_robot(robot_id: UUID, name: str) -> Place:
    """Return a place of the robot's current map. Raises `NotDone`, which lists the existing names."""
    newest = newest_maps([robot_id]).get(robot_id)
    places = places_of([newest.digest]).get(newest.digest, []) if newest else []
    for place in places:
        if place.key == key_of(name):
            return place
    if newest is None:
        text = "The server has no map of this robot yet. It reads the map while somebody has control."
    elif not places:
        text = "The robot’s map has no named places. A new map begins without any, also of the same building."
    else:
        names = ", ".join(place.name for place in places)
        text = say(
            "The robot’s map has no place named “{name}”. It has: {names}.", name=name[:60], names=names
        )
    raise NotDone(Refusal("place_unknown", text, "robot"))


class Clearance:
    """Decides where on a map its robots have room to stand."""

    def __init__(self, digest: str) -> None:
        """Raises `NotDone` if the map's picture is not stored any more, or no robot's footprint is known."""
        drawn = RobotMap.objects.filter(digest=digest).order_by("pk").last()
        if drawn is None:
            raise NotDone(NO_PICTURE)
        origin = Pose(drawn.origin_x_m, drawn.origin_y_m, drawn.origin_yaw)
        picture = bytes(drawn.picture)
        self._map = GoalMap(
            TakenMap(drawn.resolution_m, origin, drawn.width, drawn.height, picture, drawn.digest)
        )
        robots = Robot.objects.filter(maps__digest=digest).select_related("profile").distinct()
        self._footprints = []
        for robot in robots:
            try:
                self._footprints.append(footprint_of(robot_config.of(robot).gate))
            except (Problems, ValueError):
                continue  # the entry of this robot is wrong: its page says so
        if not self._footprints:
            raise NotDone(NO_OUTLINE)

    def refuse(self, pose: Pose) -> Refusal | None:
        """Return why no robot of this map can stand at `pose`; None if one can."""
        refusals = [self._map.refuse(pose, footprint) for footprint in self._footprints]
        return None if None in refusals else refusals[0]
