"""A token that is bound to robots changes nothing that other robots share or have: a table over all operations."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.test import Client
from django.utils import timezone
from rest_framework.permissions import SAFE_METHODS

from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from robots.registry.models import Robot, RobotProfile
from teleop.records import refusals
from teleop.stop import emergency_stop
from tests.robots.places.maps import map_of
from tests.teleop.api.conftest import Caller
from tests.teleop.api.test_matrix import Door, Lab, operations, stopped, table

CLOSED = {"other_robots", "not_found", "more_than_own"}
# Operations of things that several robots share in this test, or that concern all robots: closed also to a token of one
# of the robots.
SHARED = {
    *("maps_name", "places_add", "places_change", "places_delete", "places_import"),
    *("groups_change", "groups_delete", "groups_role_set", "groups_role_remove"),
    *("policies_set_common", "policies_set_group", "policies_remove_group"),
    *("qualifications_change", "qualifications_delete", "qualifications_grant", "qualifications_revoke"),
    *("courses_change", "courses_welcome", "members_enrol", "members_remove"),
    *("invitations_make", "invitations_revoke"),
    *("profiles_change", "profiles_phrases_set"),
    *("registry_add", "service_accounts_make"),
    *("webhooks_change", "webhooks_delete", "webhooks_test", "webhooks_again"),
}
EVERYWHERE = {"stop_all": "200"}  # of the token's robots
OF_ALL_ROBOTS = {
    "tokens_end",
    "own_data_export",
    "changes_undo",
    "holidays_add",
    "holidays_remove",
}  # the matrix ends a token that is not bound


@pytest.fixture
def lab(tiago: RobotProfile, monkeypatch: pytest.MonkeyPatch) -> Lab:
    monkeypatch.setattr(refusals, "record_soon", lambda _refused: None)
    monkeypatch.setattr(emergency_stop, "press_once", stopped)
    return Lab(tiago)


def changes() -> dict[str, str]:
    """Return the operations that change something: method by name."""
    return {name: method for name, (method, _path) in operations().items() if method not in SAFE_METHODS}


def bound(lab: Lab, robot: Robot) -> Caller:
    """Return a program of staff, with all scopes, for this robot only."""
    _, text = token_make(
        user=lab.people["staff"],
        name=robot.slug,
        scopes=list(Scope),
        expires_at=timezone.now() + timedelta(days=1),
        actor=lab.people["staff"],
        robots=[robot.pk],
    )
    return Caller(Client(), {"Authorization": f"Bearer {text}"})


@pytest.mark.django_db
def test_a_token_of_another_robot_changes_nothing(lab: Lab, tiago: RobotProfile) -> None:
    spare = Robot.objects.create(slug="spare", name="Spare", profile=tiago, master_uri="http://127.0.0.1:6")
    door, program = Door(operations()), bound(lab, spare)
    found = {name: door(name, program, lab.objects["staff", "own"]) for name in changes()}
    opened = {name: end for name, end in found.items() if end not in CLOSED}
    # Without a robot named, both are about the robots of the token.
    assert opened == {**EVERYWHERE, "service_tokens_make": "201", "audit_export": "200"}


@pytest.mark.django_db
def test_a_token_of_one_robot_leaves_shared_things_alone(lab: Lab) -> None:
    own, other = lab.robots["own"], lab.robots["other"]
    map_of(other, mark="own")
    map_of(other, mark="other")  # it had the map before, and has another one now
    for shared in (lab.groups["own"], lab.courses["own"], lab.webhooks["own"]):
        shared.robots.add(own, other)
    door, program = Door(operations()), bound(lab, own)
    wrong = {}
    for name in changes():
        end = door(name, program, lab.objects["staff", "own"])
        expected = table()[name].ends[0].split()[-1]  # of staff, on their own robot
        closed = name in SHARED or name in OF_ALL_ROBOTS
        if (end in CLOSED) if not closed and expected not in CLOSED else (end not in CLOSED):
            wrong[name] = end
    assert not wrong
