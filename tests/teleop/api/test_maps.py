"""Maps and places by a program. `test_matrix.py` has the permissions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from django.test import Client

from fleet.accounts.models import User
from robots.access.services import role_set
from robots.places.entries import PlaceEntry
from robots.places.models import Place
from robots.places.services import place_add
from robots.registry.models import Robot, Role
from robots.shared import wire
from teleop.api.v1.robot.tasks import TasksBase
from tests.robots.places.maps import map_of
from tests.teleop.api.conftest import Caller

pytestmark = pytest.mark.django_db
Program = Callable[..., Caller]
LAB = {"name": "lab", "x": 5.0, "y": 1.0, "heading": 0.5}


@pytest.fixture
def digest(robot: Robot, other_robot: Robot) -> str:
    return map_of(robot, other_robot)


@pytest.fixture
def kitchen(digest: str, staff: User) -> Place:
    return place_add(digest=digest, entry=PlaceEntry("kitchen", 1.0, 1.0, 1.5), actor=staff)


def test_a_map_names_only_robots_that_one_may_see(
    program: Program, operator: User, supervisor: User, staff: User, kitchen: Place
) -> None:
    for person, robots, changeable in (
        (operator, ["tiago-1"], False),
        (supervisor, ["tiago-1"], True),
        (staff, ["tiago-1", "tiago-2"], True),
    ):
        [found] = program(person)("GET", "/maps").data["maps"]
        assert (found["robots"], found["changeable"], found["map"]) == (robots, changeable, kitchen.map_id)
        assert [place["name"] for place in found["places"]] == ["kitchen"]
    assert program(staff, "read", robots=[])("GET", "/maps?robot=nobody").status_code == 404


def test_a_robot_without_a_map_has_an_empty_list(program: Program, operator: User, robot: Robot) -> None:
    answer = program(operator)("GET", "/maps?robot=tiago-1")
    assert (answer.status_code, answer.data) == (200, {"maps": []})


def test_the_picture_may_be_kept(program: Program, operator: User, digest: str) -> None:
    answer = program(operator).stream("GET", f"/maps/{digest}/picture")
    assert answer.content.startswith(b"\x89PNG")
    assert "immutable" in answer["Cache-Control"]


def test_a_token_of_one_robot_sees_the_maps_of_that_robot(
    program: Program, staff: User, robot: Robot, other_robot: Robot
) -> None:
    mine, theirs = map_of(robot), map_of(other_robot, mark="x")
    ask = program(staff, "read", "manage", robots=[robot])
    assert [found["map"] for found in ask("GET", "/maps").data["maps"]] == [mine]
    assert ask("POST", f"/maps/{theirs}/places", LAB).status_code == 404


def test_places_are_added_renamed_moved_and_deleted(program: Program, supervisor: User, digest: str) -> None:
    ask = program(supervisor)
    added = ask("POST", f"/maps/{digest}/places", LAB)
    address, tag = added["Location"].removeprefix("/api/v1"), added["ETag"]
    assert (added.status_code, added.data | {"number": 0}) == (201, LAB | {"number": 0})
    assert ask("PATCH", address, {"name": "Lab 2"}).data["code"] == "if_match_missing"
    renamed = ask("PATCH", address, {"name": "Lab 2"}, If_Match=tag)
    assert (renamed.status_code, renamed.data["name"], renamed.data["x"]) == (200, "Lab 2", 5.0)
    assert ask("PATCH", address, {"x": 4.5}, If_Match=tag).data["code"] == "changed"
    moved = ask("PATCH", address, {"x": 4.5}, If_Match=ask("GET", address)["ETag"])
    assert (moved.data["x"], moved.data["name"]) == (4.5, "Lab 2")
    assert (
        ask("PATCH", address, {"x": 3.0, "y": 2.0}, If_Match=moved["ETag"]).data["code"] == "goal_in_obstacle"
    )
    assert ask("DELETE", address).status_code == 204
    assert ask("GET", address).status_code == 404
    assert ask("GET", f"/maps/{digest}/places").data == {"places": []}


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        (b'{"name": "lab", "x": NaN, "y": 1}', 400, "not_json"),
        ({"name": "lab", "x": 1e300, "y": 1.0}, 400, "invalid"),
        ({"name": "x" * 61, "x": 1.0, "y": 1.0}, 400, "invalid"),
        ({"name": "@home", "x": 1.0, "y": 1.0}, 400, "invalid"),
        ({"name": "KITCHEN ", "x": 1.0, "y": 1.0}, 409, "name_taken"),
        ({"name": "moon", "x": 400.0, "y": 1.0}, 409, "goal_outside"),
        ({"name": "pillar", "x": 3.0, "y": 2.0}, 409, "goal_in_obstacle"),
    ],
)
def test_a_bad_place_is_refused_in_words(
    program: Program, staff: User, kitchen: Place, body: Any, status: int, code: str
) -> None:
    answer = program(staff)("POST", f"/maps/{kitchen.map_id}/places", body)
    assert (answer.status_code, answer.data["code"]) == (status, code)
    assert answer.data["detail"]
    assert Place.objects.count() == 1


def test_a_map_is_named(program: Program, supervisor: User, digest: str) -> None:
    ask = program(supervisor)
    tag = ask("GET", f"/maps/{digest}")["ETag"]
    named = ask("PATCH", f"/maps/{digest}", {"name": "Ground floor"}, If_Match=tag)
    assert (named.status_code, named.data["name"]) == (200, "Ground floor")
    assert ask("PATCH", f"/maps/{digest}", {"name": ""}, If_Match=tag).data["code"] == "changed"


def test_a_file_of_one_map_is_imported_to_the_next(
    program: Program,
    supervisor: User,
    stranger: User,
    kitchen: Place,
    robot: Robot,
    signed_in: Callable[[User], Client],
) -> None:
    ask = program(supervisor)
    text = ask.stream("GET", f"/maps/{kitchen.map_id}/places/export").content.decode()
    assert text == "name,x,y,heading\nkitchen,1.0,1.0,1.5\n"
    page = f"/maps/{kitchen.map_id}/places.csv"
    assert signed_in(supervisor).get(page).content.decode() == f"\ufeff{text}"  # for Excel
    assert signed_in(stranger).get(page).status_code == 404
    newer = map_of(robot, mark="x")
    present, earlier = ask("GET", "/maps?robot=tiago-1").data["maps"]
    assert (present["map"], present["places"], earlier["map"]) == (newer, [], kitchen.map_id)
    for done in ({"added": 1, "changed": 0, "unchanged": 0}, {"added": 0, "changed": 0, "unchanged": 1}):
        assert ask("POST", f"/maps/{newer}/places/import", {"csv": text}).data == done


def test_wrong_lines_of_an_import_are_named(program: Program, staff: User, digest: str) -> None:
    text = "name,x,y,heading\nkitchen,nan,1,0\nlab,1,1,0\nmoon,400,1,0\n"
    answer = program(staff)("POST", f"/maps/{digest}/places/import", {"csv": text})
    assert (answer.status_code, [one["text"][:7] for one in answer.data["refusals"]]) == (400, ["line 2:"])
    five_thousand = "name,x,y,heading\n" + "".join(f"p{number},1,1,0\n" for number in range(5000))
    answer = program(staff)("POST", f"/maps/{digest}/places/import", {"csv": five_thousand})
    assert "5000 places; a map has at most 200" in answer.data["detail"]
    assert not Place.objects.exists()


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[wire.Go]:
    """The messages to the robot; this test has no robot."""
    orders: list[wire.Go] = []

    def start(_view: TasksBase, _robot: Robot, order: Callable[[int, int], wire.Go]) -> None:
        orders.append(order(7, 1))

    monkeypatch.setattr(TasksBase, "start", start)
    return orders


def test_a_robot_is_sent_to_a_place_by_its_name(
    program: Program, operator: User, kitchen: Place, sent: list[wire.Go]
) -> None:
    ask = program(operator)
    ask("POST", "/robots/tiago-1/go", {"place": "Kitchen"})
    ask("POST", "/robots/tiago-1/go", {"place": "kitchen", "heading": 0.1})
    ask("POST", "/robots/tiago-1/go", {"x": 2.0, "y": 1.0})
    assert [(go.x, go.y, go.heading) for go in sent] == [(1.0, 1.0, 1.5), (1.0, 1.0, 0.1), (2.0, 1.0, 0.0)]
    for body, code in (
        ({"place": "cellar"}, "place_unknown"),
        ({"place": "kitchen", "x": 1.0, "y": 1.0}, "invalid"),
        ({"x": 1.0}, "invalid"),
        ({}, "invalid"),
    ):
        assert ask("POST", "/robots/tiago-1/go", body).data["code"] == code
    assert len(sent) == 3


def test_a_place_on_a_map_of_robots_that_one_may_not_see_is_not_found(
    program: Program, supervisor: User, other_robot: Robot, robot: Robot, staff: User
) -> None:
    theirs = map_of(other_robot, mark="x")
    map_of(robot)
    assert program(supervisor)("POST", f"/maps/{theirs}/places", LAB).status_code == 404
    role_set(robot=other_robot, user=supervisor, role=Role.OPERATOR, actor=staff)
    refused = program(supervisor)("POST", f"/maps/{theirs}/places", LAB)
    assert (refused.status_code, refused.data["code"]) == (403, "permission_denied")
