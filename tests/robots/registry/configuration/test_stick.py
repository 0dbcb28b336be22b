"""Input filters of a robot's stick: from profile or robot to its bridge, and errors about them."""

from __future__ import annotations

import json
from typing import Any

import pytest
from django.core.exceptions import ValidationError
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.registry.models import Robot, RobotProfile
from robots.registry.selectors import bridge_config, robot_facts
from robots.shared.configuration.input_filters import Curve, DeadZone, Mean, OneEuro, Snap
from tests.robots.registry.test_admin import filled

pytestmark = pytest.mark.django_db


def test_a_robot_takes_its_profiles_steps(robot: Robot) -> None:
    assert bridge_config(robot).stick == (DeadZone(0.03), Curve(1.0), OneEuro(1.0, 5.0, 1.0))
    robot.profile.stick = [{"step": "snap"}]
    assert bridge_config(robot).stick == (Snap(15.0, 0.25),)


def test_the_page_shows_the_sticks_filters(robot: Robot) -> None:
    assert robot_facts(robot).stick == "dead zone 0.03, smoothed (One-Euro)"
    robot.stick = [{"step": "scale", "w": 0.5}, {"step": "mean"}, {"step": "snap"}]
    assert robot_facts(robot).stick == (
        "scaled (forward 1, left 1, turn 0.5), smoothed (mean of 5), sideways turns on the spot at 25%"
    )
    robot.stick = []
    assert robot_facts(robot).stick == "no filter"


def test_a_robots_own_steps_take_their_place_in_order(robot: Robot) -> None:
    robot.stick = [{"step": "mean", "count": 5}, {"step": "dead_zone", "width": 0.1}]
    robot.full_clean()
    assert bridge_config(robot).stick == (Mean(5), DeadZone(0.1))


def test_a_robot_may_do_without_any(robot: Robot) -> None:
    robot.stick = []
    robot.full_clean()
    robot.save()
    robot.refresh_from_db()
    assert bridge_config(robot).stick == ()


def test_other_steps_are_news_to_the_bridge(robot: Robot) -> None:
    before = bridge_config(robot).digest()
    robot.stick = []
    assert bridge_config(robot).digest() != before


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        (
            [{"step": "smooth"}],
            "stick[0].step: there is no step 'smooth' (there are: curve, dead_zone, mean,",
        ),
        ([{"width": 0.1}], "stick[0].step: there is no step None"),
        (
            [{"step": "curve"}, {"step": "dead_zone", "width": 0.9}],
            "stick[1].width: Expected a number <= 0.5",
        ),
        ([{"step": "mean", "count": 2.5}], "stick[0].count: Expected a whole number, got a number"),
        ([{"step": "scale", "v": 1}], "stick[0].v: there is no such field (there are: step, w, x, y)"),
        ([{"step": "curve"}, {"step": "curve"}], "stick[1].step: 'curve' occurs twice"),
        ([{"step": "mean"}, {"step": "one_euro"}], "one of one_euro and mean steadies the stick, not both"),
        ([{"step": "one_euro", "beta": float("nan")}], "stick[0].beta: must be a finite number"),
        ({"step": "curve"}, "stick: Expected a list, got an object"),
        (["curve"], "stick[0]: Expected an object, got text"),
    ],
)
@pytest.mark.parametrize("kind", ["robot", "profile"])
def test_errors_are_shown_with_their_place(robot: Robot, kind: str, steps: Any, said: str) -> None:
    entry: Robot | RobotProfile = robot if kind == "robot" else robot.profile
    entry.stick = steps
    with pytest.raises(ValidationError) as caught:
        entry.full_clean()
    assert said in " ".join(caught.value.message_dict["stick"])


def test_edits_of_the_steps_in_the_admin_are_recorded(robot: Robot, staff: User, signed_in: Any) -> None:
    admin: Client = signed_in(staff)
    url = reverse("admin:robots_robot_change", args=[robot.pk])
    steps = [{"step": "one_euro", "min_hz": 2.0}, {"step": "snap"}]
    assert admin.post(url, filled(admin, url, stick=json.dumps(steps))).status_code == 302
    robot.refresh_from_db()
    assert bridge_config(robot).stick == (OneEuro(2.0), Snap())
    (change,) = Record.objects.get(kind="robot.change").parameters["changes"]
    assert change == {"field": "stick", "from": None, "to": steps}
    page = admin.post(url, filled(admin, url, stick='[{"step": "smooth"}]')).content.decode()
    assert "there is no step &#x27;smooth&#x27;" in page
