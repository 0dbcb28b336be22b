"""Shared layouts of a robot's page: shared, read and deleted through the API, within limits, recorded."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.registry.models import Robot
from teleop.models import SharedLayout
from tests.teleop.api.conftest import Caller

pytestmark = pytest.mark.django_db
ADDRESS = "/robots/tiago-1/layouts"
SURVEY = {
    "name": "Survey",
    "cells": ["map", "plot /odom pose.pose.position.x ranges[0]", "plot"],
    "side": False,
    "stick": False,
    "panels": ["motions", "chart", "phrases"],
}


@pytest.fixture
def manager(staff: User, robot: Robot, program: Callable[..., Caller]) -> Caller:
    return program(staff)


def test_a_layout_is_shared_and_deleted(manager: Caller) -> None:
    made = manager("POST", ADDRESS, SURVEY)
    assert made.status_code == 201
    assert manager("GET", ADDRESS).data == {"layouts": [{**SURVEY, "number": made.data["number"]}]}
    assert manager("DELETE", f"{ADDRESS}/{made.data['number']}").status_code == 204
    assert manager("GET", ADDRESS).data == {"layouts": []}
    records = Record.objects.filter(kind__startswith="layout.").order_by("pk")
    assert [(one.kind, one.parameters, one.robot_name) for one in records] == [
        ("layout.share", SURVEY, "TIAGo 1"),
        ("layout.delete", SURVEY, "TIAGo 1"),
    ]


@pytest.mark.parametrize(
    ("change", "refusal"),
    [
        ({"name": "SURVEY"}, (409, "name_taken")),
        ({"cells": ["map", "map"]}, (400, "invalid")),
        ({"cells": ["map", "camera", "plan", "scene", "second"]}, (400, "invalid")),
        ({"cells": ["hologram"]}, (400, "invalid")),
        ({"cells": ["plot /odom;x"]}, (400, "invalid")),
        ({"cells": ["plot /odom " + " ".join("abcdefg")]}, (400, "invalid")),
        ({"panels": ["chart", "chart", "phrases"]}, (400, "invalid")),
        ({"name": "x" * 41}, (400, "invalid")),
        ({"name": " "}, (400, "name_unseen")),
    ],
)
def test_a_refused_layout_changes_nothing(
    change: dict[str, object], refusal: tuple[int, str], manager: Caller
) -> None:
    manager("POST", ADDRESS, SURVEY)
    answer = manager("POST", ADDRESS, {**SURVEY, "name": "Other", **change})
    assert (answer.status_code, answer.data["code"]) == refusal
    assert SharedLayout.objects.count() == 1


def test_a_robot_has_at_most_twenty_layouts(manager: Caller, robot: Robot) -> None:
    SharedLayout.objects.bulk_create(SharedLayout(robot=robot, name=f"{n}", panels=[]) for n in range(20))
    answer = manager("POST", ADDRESS, SURVEY)
    assert (answer.status_code, answer.data["code"]) == (409, "too_many")
