"""Named places: each belongs to a map, must be on free floor, and can be saved in a file."""

from __future__ import annotations

import math
from datetime import timedelta
from typing import Any

import pytest
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.places.entries import MOST_PLACES, PlaceEntry, entry_of, file_text, read
from robots.places.models import Place, SharedMap
from robots.places.selectors import maps_of, place_of_robot
from robots.places.services import map_name, place_add, place_change, place_delete, places_import
from robots.registry.configuration.profile_schema import Problems
from robots.registry.models import Robot, RobotMap
from robots.shared.wire import NotDone
from teleop.reports.session_maps import remove_unneeded
from tests.robots.places.maps import map_of

pytestmark = pytest.mark.django_db
KITCHEN = PlaceEntry("kitchen", 1.0, 1.0, 0.5)


@pytest.fixture
def digest(robot: Robot) -> str:
    return map_of(robot)


def refusal_of(call: Any, **arguments: Any) -> str:
    with pytest.raises(NotDone) as error:
        call(**arguments)
    return error.value.refusal.code


def faults(text: str) -> list[str]:
    with pytest.raises(Problems) as error:
        read(text)
    return error.value.lines


# --- of a map -------------------------------------------------------------------------------------


def test_robots_with_the_same_map_share_its_places(robot: Robot, other_robot: Robot, staff: User) -> None:
    digest = map_of(robot, other_robot)
    place_add(digest=digest, entry=KITCHEN, actor=staff)
    assert place_of_robot(other_robot.id, "  KITCHEN ").x_m == 1.0
    [found] = maps_of([robot, other_robot])
    assert (found.digest, found.robots, found.earlier) == (digest, [robot, other_robot], [])


def test_a_new_map_has_no_places_and_the_earlier_one_keeps_its_own(
    robot: Robot, digest: str, staff: User
) -> None:
    place_add(digest=digest, entry=KITCHEN, actor=staff)
    newer = map_of(robot, mark="x")
    assert newer != digest
    with pytest.raises(NotDone, match="A new map begins without any"):
        place_of_robot(robot.id, "kitchen")
    map_of(robot)
    newer = map_of(robot, mark="x")  # changed to and fro: a map keeps only its newest row
    present, before = maps_of([robot])
    assert (present.digest, before.digest, before.robots, before.earlier) == (newer, digest, [], [robot])
    list(remove_unneeded(timezone.now() + timedelta(days=900)))
    assert list(RobotMap.objects.values_list("digest", flat=True)) == [digest]  # this map has places


def test_the_places_that_there_are_are_named(robot: Robot, digest: str, staff: User) -> None:
    with pytest.raises(NotDone, match="has no named places"):
        place_of_robot(robot.id, "kitchen")
    place_add(digest=digest, entry=KITCHEN, actor=staff)
    with pytest.raises(NotDone, match="It has: kitchen"):
        place_of_robot(robot.id, "cellar")


def test_a_robot_without_a_map_has_no_place(robot: Robot) -> None:
    with pytest.raises(NotDone, match="has no map"):
        place_of_robot(robot.id, "kitchen")
    assert maps_of([robot]) == []


# --- changes --------------------------------------------------------------------------------------


def test_changes_are_on_record(digest: str, staff: User) -> None:
    place = place_add(digest=digest, entry=KITCHEN, actor=staff)
    place_change(place=place, entry=PlaceEntry("Küche", 1.2, 1.0), actor=staff)
    place_change(place=place, entry=PlaceEntry("Küche", 1.2, 1.0), actor=staff)  # nothing to record
    place_delete(place=place, actor=staff)
    map_name(digest=digest, name="Ground floor", actor=staff)
    kinds = ["place.create", "place.change", "place.delete", "map.name"]
    records = Record.objects.filter(kind__in=kinds).order_by("id")
    assert [one.kind for one in records] == kinds
    assert records[1].parameters["from"] == {"name": "kitchen", "x_m": 1.0, "y_m": 1.0, "heading_rad": 0.5}
    assert {one.actor_id for one in records} == {str(staff.pk)}
    assert str(SharedMap.objects.get()) == "Ground floor"


@pytest.mark.parametrize(
    ("entry", "code"),
    [
        (PlaceEntry("kitchen", math.nan, 1.0), "invalid"),
        (PlaceEntry("kitchen", 1.0, math.inf), "invalid"),
        (PlaceEntry("kitchen", 1.0, 1.0, 7.0), "invalid"),
        (PlaceEntry("", 1.0, 1.0), "invalid"),
        (PlaceEntry("x" * 61, 1.0, 1.0), "invalid"),
        (PlaceEntry("=cmd", 1.0, 1.0), "invalid"),
        (PlaceEntry("a\nb", 1.0, 1.0), "invalid"),
        (PlaceEntry("kitchen", 40.0, 1.0), "goal_outside"),
        (PlaceEntry("kitchen", -0.4, -0.4), "goal_outside"),
        (PlaceEntry("kitchen", 3.0, 2.2), "goal_in_obstacle"),  # beside the pillar
        (PlaceEntry("kitchen", 0.2, 1.0), "goal_in_obstacle"),  # against the wall
        (PlaceEntry("HALL", 1.0, 1.0), "name_taken"),
    ],
)
def test_what_is_no_place_is_refused(digest: str, staff: User, entry: PlaceEntry, code: str) -> None:
    place_add(digest=digest, entry=PlaceEntry("hall", 5.0, 1.0), actor=staff)
    assert refusal_of(place_add, digest=digest, entry=entry, actor=staff) == code
    other = place_add(digest=digest, entry=PlaceEntry("other", 5.0, 3.0), actor=staff)
    assert refusal_of(place_change, place=other, entry=entry, actor=staff) == code
    assert list(Place.objects.values_list("name", flat=True)) == ["hall", "other"]


def test_without_the_outline_of_any_robot_no_place_is_taken(robot: Robot, digest: str, staff: User) -> None:
    Robot.objects.filter(pk=robot.pk).update(overrides={"nonsense": 1})
    assert refusal_of(place_add, digest=digest, entry=KITCHEN, actor=staff) == "no_outline"


def test_a_map_has_room_for_so_many_places(digest: str, staff: User) -> None:
    many = {line: PlaceEntry(f"place {line}", 1.0, 1.0) for line in range(MOST_PLACES)}
    assert places_import(digest=digest, entries=many, actor=staff).added == MOST_PLACES
    assert refusal_of(place_add, digest=digest, entry=KITCHEN, actor=staff) == "too_many"
    with pytest.raises(Problems, match="would have 201"):
        places_import(digest=digest, entries={1: KITCHEN}, actor=staff)


# --- files ----------------------------------------------------------------------------------------


def test_an_import_adds_and_moves_and_twice_is_harmless(digest: str, staff: User) -> None:
    place_add(digest=digest, entry=KITCHEN, actor=staff)
    place_add(digest=digest, entry=PlaceEntry("stays", 1.0, 3.0), actor=staff)
    entries = read("\ufeffname,x,y,heading\r\nKitchen,2,1,\r\n\r\nhall,5.0,1.0,3.2\r\n")
    done = places_import(digest=digest, entries=entries, actor=staff)
    assert (done.added, done.changed, done.unchanged) == (1, 1, 0)
    again = places_import(digest=digest, entries=entries, actor=staff)
    assert (again.added, again.changed, again.unchanged) == (0, 0, 2)
    assert Record.objects.filter(kind="place.import").count() == 1
    held = {place.name: (place.x_m, place.y_m, place.heading_rad) for place in Place.objects.all()}
    assert held == {"Kitchen": (2, 1, 0), "hall": (5, 1, -3.083), "stays": (1, 3, 0)}


def test_a_file_with_a_bad_place_changes_nothing(digest: str, staff: User) -> None:
    entries = read("name,x,y,heading\nkitchen,1,1,0\npillar,3,2.2,0\nmoon,400,1,0\n")
    with pytest.raises(Problems) as error:
        places_import(digest=digest, entries=entries, actor=staff)
    first, second = error.value.lines
    assert first.startswith("line 3, “pillar”: The robot has no room")
    assert second.startswith("line 4, “moon”: This place is outside")
    assert not Place.objects.exists()


def test_an_exported_file_is_read_again() -> None:
    entries = [
        entry_of("west", 1.0, 1.0, math.pi),
        entry_of("Küche, hinten", 1.5, -2.0, 6.0),
        entry_of('the "old" lab', 0.0, 0.0, 0.0),
    ]
    assert file_text(entries).startswith("name,")
    assert list(read(file_text(entries)).values()) == entries
    assert list(read(file_text(entries).replace("\n", "\r")).values()) == entries
    assert list(read("Name;X;Y;Heading\nlab;1;2;\n").values()) == [PlaceEntry("lab", 1.0, 2.0)]
    quoted = '\ufeff"name";"x";"y";"heading"\r\n"lab";"1";"2";"0"\r\n'
    assert read(quoted) == {2: PlaceEntry("lab", 1.0, 2.0)}


def test_wrong_lines_of_a_file_are_named() -> None:
    text = "name,x,y,heading\nkitchen,nan,1,0\nlab,1,,0\nhall,a,1\n,1,1,0\nok,1,1\nOK,2,2\na,b\n"
    assert [line.split(":")[0] for line in faults(text)] == [f"line {line}" for line in (2, 3, 4, 5, 7, 8)]
    assert "Line 6 has a place named" in faults(text)[4]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "names the columns"),
        ("kitchen,1,2,3\n", "names the columns"),
        ("name,x,y,heading\n", "no place in the file"),
        ("\0\0\0", "names the columns"),
        ("name,x,y,heading\n" + "a" * 200_000, "more than 100 kB"),
        ('name,x,y,heading\n"open,1,2,3', "fields"),
        ('"name,x,y,heading\nlab,1,2,3', "names the columns"),
        (
            "name,x,y,heading\nlab,1,1,1\nK\ufffdche,1,2,3",
            "line 3: “K\ufffdche” has a letter that is not UTF-8",
        ),
    ],
)
def test_what_is_no_file_of_places_is_refused(text: str, words: str) -> None:
    assert words in " ".join(faults(text))


def test_five_thousand_places_are_too_many() -> None:
    text = "name,x,y,heading\n" + "".join(f"p{number},1,1,0\n" for number in range(5000))
    assert faults(text) == ["There are 5000 places; a map has at most 200."]
