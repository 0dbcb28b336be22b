"""The admin's form of a robot: little to fill in, and the check after saving."""

from __future__ import annotations

from typing import Any

import pytest
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from fleet.site.admin.robot_entries import MOST_ROWS
from robots.registry.models import Allowance, Robot, RobotProfile, RobotRole
from tests.robots.registry.test_admin import filled

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


PEOPLE = 130


def test_a_robot_with_hundreds_of_roles_and_entries_is_saved(
    admin: Client, robot: Robot, operator: User, django_assert_max_num_queries: Any
) -> None:
    people = User.objects.bulk_create(User(username=f"person-{number}") for number in range(PEOPLE))
    RobotRole.objects.bulk_create(RobotRole(robot=robot, user=one, role="observer") for one in people)
    Allowance.objects.bulk_create(
        Allowance(robot=robot, what="publish", name=f"/t{n}", type="std_msgs/Empty", role="operator")
        for n in range(PEOPLE)
    )
    address = reverse("admin:robots_robot_change", args=[robot.pk])
    with django_assert_max_num_queries(30):
        page = admin.get(address)
    roles = page.context["inline_admin_formsets"][0].formset
    assert (len(roles.initial_forms), f"all {PEOPLE + 1}" in page.content.decode()) == (MOST_ROWS, True)
    first = roles.initial_forms[5]
    sent = filled(admin, address, name="Tia Three", **{f"{first.prefix}-role": "supervisor"})
    answer = admin.post(address, sent)
    assert answer.status_code == 302, (
        answer.context["errors"],
        [f.formset.errors[:3] for f in answer.context["inline_admin_formsets"]],
    )
    robot.refresh_from_db()
    assert robot.name == "Tia Three"
    assert RobotRole.objects.get(pk=first.instance.pk).role == "supervisor"
    assert RobotRole.objects.filter(robot=robot, role="observer").count() == PEOPLE - 1
    entries = f"{reverse('admin:robots_robotrole_changelist')}?robot__id__exact={robot.pk}"
    assert f"{PEOPLE + 1} roles on robots" in admin.get(entries).content.decode()
