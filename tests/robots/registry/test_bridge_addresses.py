"""Two robots cannot share a bridge address. An address shared before this check works until somebody edits it."""

from __future__ import annotations

import pytest
from django.core.exceptions import ValidationError
from django.db import IntegrityError, transaction
from django.test import Client
from django.urls import reverse

from robots.registry import services
from robots.registry.models import Robot
from robots.registry.selectors import link_address

pytestmark = pytest.mark.django_db
ADDRESS = "wss://bridges.lab:7443"


def test_a_second_robot_at_one_address_is_refused_in_words(robot: Robot, other_robot: Robot) -> None:
    robot.bridge_address = ADDRESS
    services.robot_save(robot=robot, actor=None)
    other_robot.bridge_address = ADDRESS
    with pytest.raises(ValidationError) as refused:
        services.robot_save(robot=other_robot, actor=None)
    (message,) = refused.value.message_dict["bridge_address"]
    assert "Another robot" in message
    with pytest.raises(IntegrityError), transaction.atomic():
        Robot.objects.filter(pk=other_robot.pk).update(bridge_address=ADDRESS)


def test_the_admin_says_it_at_the_field(robot: Robot, other_robot: Robot, staff, signed_in) -> None:
    Robot.objects.filter(pk=other_robot.pk).update(bridge_address=ADDRESS)
    client: Client = signed_in(staff)
    page = reverse("admin:robots_robot_change", args=[robot.pk])
    form = client.get(page).context["adminform"].form
    entered = {name: "" if value is None else value for name, value in form.initial.items()}
    texts = {name: form[name].value() for name in ("host_aliases", "overrides", "stick")}
    empty = {"TOTAL_FORMS": 0, "INITIAL_FORMS": 0}
    rows = {f"{prefix}-{name}": 0 for prefix in ("roles", "allowances") for name in empty}
    answer = client.post(page, {**entered, **texts, **rows, "bridge_address": ADDRESS})
    errors = answer.context["adminform"].form.errors
    assert list(errors) == ["bridge_address"]
    assert "Another robot’s bridge" in errors["bridge_address"][0]


def test_any_number_of_bridges_run_on_this_computer(robot: Robot, other_robot: Robot) -> None:
    for one in (robot, other_robot):
        services.robot_save(robot=one, actor=None)
        assert one.bridge_address == ""


def test_a_doubled_address_works_until_it_is_edited(robot: Robot, other_robot: Robot) -> None:
    """Databases from before this rule have a mark in the second robot's address."""
    robot.bridge_address, other_robot.bridge_address = ADDRESS, f"{ADDRESS}#2"
    assert [(to.host, to.port) for to in map(link_address, (robot, other_robot))] == [
        ("bridges.lab", 7443)
    ] * 2
    with pytest.raises(ValidationError, match="has something after the port"):
        other_robot.full_clean()
