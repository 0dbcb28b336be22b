"""The content that script/demo creates at its start."""

from __future__ import annotations

import json
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from django.core.management import call_command

from fleet.accounts.models import User
from robots.access.selectors import role_on
from robots.places.models import Place
from robots.places.selectors import place_of_robot
from robots.registry.models import Robot, Role
from robots.registry.selectors import allowed_on, phrases_of

pytestmark = pytest.mark.django_db


@pytest.fixture
def seed(tmp_path: Path) -> Any:
    """`seed(master_uri)`: run the command of script/demo's start; return its output."""

    def run(master_uri: str = "http://127.0.0.1:11311") -> Any:
        robot = {
            "slug": "p-1",
            "name": "Practice",
            "master_uri": master_uri,
            "advertised_address": "127.0.0.1",
        }
        accounts = [{"username": role, "role": role, "password": "secret"} for role in ("staff", "operator")]
        plan = tmp_path / "plan.json"
        plan.write_text(json.dumps({"robots": [robot], "accounts": accounts}))
        printed = StringIO()
        call_command("seed_demo", plan, stdout=printed)
        return json.loads(printed.getvalue())

    return run


def test_a_practice_robot_drives_speaks_and_has_examples(seed: Any) -> None:
    assert list(seed()) == ["p-1"]
    robot = Robot.objects.get(slug="p-1")
    assert (robot.practice, role_on(User.objects.get(username="operator"), robot)) == (True, Role.OPERATOR)
    assert len(phrases_of(robot)) == 24
    tried = {(entry.what, entry.name, entry.role) for entry in allowed_on(robot)}
    assert tried == {
        ("choose", "/phone_vel", "operator"),
        ("publish", "/fleet_demo/notes", "operator"),
        ("publish", "/fleet_demo/place", "operator"),
        ("call", "/play_motion/list_motions", "staff"),
        ("call", "/fleet/clients/add_two_ints", "operator"),
        ("call", "/fleet/clients/fibonacci", "operator"),
        ("set", "/fleet_demo/greeting", "staff"),
    }


def test_a_second_start_keeps_peoples_changes(seed: Any) -> None:
    seed()
    robot = Robot.objects.get(slug="p-1")
    robot.allowances.all().delete()
    seed("http://127.0.0.1:22622")
    robot.refresh_from_db()
    assert robot.master_uri == "http://127.0.0.1:22622"
    assert allowed_on(robot) == ()


def test_practice_robots_have_places_and_deleted_ones_stay_away(seed: Any) -> None:
    seed()
    robot = Robot.objects.get(slug="p-1")
    kitchen = place_of_robot(robot.id, "kitchen")
    assert {place.name for place in kitchen.map.places.all()} >= {"kitchen", "charging dock"}
    kitchen.delete()
    seed()
    assert not Place.objects.filter(name="kitchen").exists()
