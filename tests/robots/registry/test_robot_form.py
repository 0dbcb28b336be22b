"""The admin's form of a robot: little to fill in, and the check after saving."""

from __future__ import annotations

import pytest
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from robots.registry.models import Robot, RobotProfile

ENTERED = {"name": "Tia Two", "master_uri": "http://tiago-42c:11311", "enabled": "on", "max_share": "1"}


@pytest.fixture
def admin(client: Client, staff: User) -> Client:
    client.force_login(staff)
    return client


def add(admin: Client, profile: RobotProfile, **more: str) -> str:
    found = admin.get(reverse("admin:robots_robot_add")).context["inline_admin_formsets"]
    forms = {}
    for inline in found:
        forms |= {f"{inline.formset.prefix}-TOTAL_FORMS": "0", f"{inline.formset.prefix}-INITIAL_FORMS": "0"}
    typed = {**ENTERED, "profile": str(profile.pk), "_save": "Save", **forms, **more}
    return admin.post(reverse("admin:robots_robot_add"), typed).headers["Location"]


def test_name_profile_and_master_make_a_robot_and_check_it(admin: Client, tiago: RobotProfile) -> None:
    assert add(admin, tiago) == reverse("robot-check", args=["tia-two"])
    assert add(admin, tiago, name="Tia Two!") == reverse("robot-check", args=["tia-two-2"])
    robot = Robot.objects.get(slug="tia-two")
    assert (robot.host_aliases, robot.overrides, robot.profile) == ({}, {}, tiago)


def test_the_rest_is_folded_and_has_boxes_for_rows(admin: Client) -> None:
    page = admin.get(reverse("admin:robots_robot_add")).content.decode()
    assert page.count("<details>") == 2
    assert 'data-pairs="text"' in page
    assert 'data-pairs="grouped"' in page
