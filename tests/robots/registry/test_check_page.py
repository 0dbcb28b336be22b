"""The robot check page makes one check of a robot at a time; a second request does not wait."""

from __future__ import annotations

from unittest import mock

import pytest
from django.test import Client
from django.urls import reverse

from robots.check import views
from robots.registry.models import Robot

pytestmark = pytest.mark.django_db


def test_a_second_check_is_refused_at_once(staff, signed_in, robot: Robot) -> None:
    client: Client = signed_in(staff)
    with views._probed[robot.id], mock.patch.object(views, "run_checks", autospec=True) as run_checks:
        page = client.get(reverse("robot-check", args=[robot.slug]))
    assert "Somebody else is checking this robot just now" in page.content.decode()
    run_checks.assert_not_called()


def test_a_check_of_one_robot_holds_up_no_other(staff, signed_in, robot: Robot, other_robot: Robot) -> None:
    client: Client = signed_in(staff)
    with (
        views._probed[robot.id],
        mock.patch.object(views, "run_checks", autospec=True, return_value=[]) as checks,
    ):
        client.get(reverse("robot-check", args=[other_robot.slug]))
    checks.assert_called_once_with(other_robot)
