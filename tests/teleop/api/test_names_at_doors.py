"""A name that people choose is refused at every door: forms, the admin, REST, lists, single sign-on.

`COLUMNS` has each text column of the console that holds such a name; a new column is in no list, so the test fails.
"""

# ruff: noqa: RUF001  # letters that look like others are the subject

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from urllib.parse import urlencode

import pytest
from django.apps import apps
from django.core.exceptions import ValidationError
from django.db import models
from django.test import Client

from fleet.accounts.models import User
from fleet.accounts.sign_in.adapters import AccountAdapter
from fleet.base.names import NameField
from fleet.bookings.models import Booking, State
from robots.registry.models import Robot, RobotProfile
from tests.teleop.api.conftest import Caller
from tests.teleop.api.test_bookings import hour, words

OURS = ("accounts", "access", "bookings", "places", "robots", "teleop")
# Columns of texts that are no names: words that the console or a robot wrote, keys, addresses, formats.
OTHER_COLUMNS = ("slug", "digest", "language", "state", "why", "role", "kind", "tab", "key")
FORGED = ("night\nshift", "night\u202eshift", "night\u200bshift")


def test_every_column_for_a_name_checks_it() -> None:
    plain = {
        f"{model._meta.label}.{field.name}"
        for model in apps.get_models()
        if model._meta.app_label in OURS
        for field in model._meta.get_fields()
        if isinstance(field, models.CharField)
        and not isinstance(field, NameField)
        and field.name in ("name", "full_name", "title", "purpose", "note", "label", "project", "description")
    }
    assert plain == {
        "robots.Allowance.name",  # of a topic, a service or a parameter of the robot
        "places.SharedMap.name",  # `robots.places.entries` checks both
        "places.Place.name",
        "robots.BridgeHost.name",  # of a computer: its own form checks it
    }


@pytest.fixture
def manager(staff: User, program: Callable[..., Caller]) -> Caller:
    return program(staff)


def _refused(answer: Any) -> tuple[int, str]:
    return answer.status_code, answer.data["code"]


TERM = {"starts_on": "2027-01-01", "ends_on": "2027-02-01"}
BY_REST: dict[str, dict[str, Any]] = {
    "/tokens": {"scopes": ["read"]},
    "/service-accounts": {"project": "Lab"},
    "/robot-groups": {"robots": ["tiago-1"]},
    "/qualifications": {"robots": ["tiago-1"]},
    "/courses": {"robots": ["tiago-1"], **TERM},
    "/registry": {"profile": "tiago", "master_uri": "http://127.0.0.1:7"},
    "/robots/tiago-1/layouts": {"cells": ["camera"]},
    "/webhooks": {"address": "https://example.org/x", "kinds": ["stops"]},
}


@pytest.mark.parametrize("address", BY_REST)
@pytest.mark.parametrize("name", FORGED)
def test_rest_refuses_a_forged_name(address: str, name: str, robot: Robot, manager: Caller) -> None:
    answer = manager("POST", address, {"name": name, **BY_REST[address]})
    assert _refused(answer) == (400, "name_unseen")


@pytest.mark.parametrize("name", FORGED)
def test_words_about_bookings_have_no_hidden_characters(name: str, robot: Robot, manager: Caller) -> None:
    slot = {"robot": robot.slug, "starts_at": words(hour(24)), "ends_at": words(hour(25))}
    for field in ("purpose", "override"):
        assert _refused(manager("POST", "/bookings", {**slot, field: name})) == (400, "name_unseen")
    assert _refused(manager("POST", "/waiting", {**slot, "purpose": name})) == (400, "name_unseen")
    assert not Booking.objects.exists()
    made = manager("POST", "/bookings", slot).data
    address = f"/bookings/{made['id']}?{urlencode({'reason': name})}"
    assert _refused(manager("DELETE", address, If_Match='"1"')) == (400, "name_unseen")
    assert Booking.objects.get().state == State.BOOKED


def test_slugs_are_no_words_of_addresses(robot: Robot, manager: Caller) -> None:
    register = {"profile": "tiago", "master_uri": "http://127.0.0.1:7"}
    answer = manager("POST", "/registry", {"name": "Nobody", "slug": "none", **register})
    assert _refused(answer) == (400, "name_reserved")
    assert manager("POST", "/registry", {"name": "None", **register}).data["slug"] == "none-2"
    assert manager("POST", "/robot-groups", {"name": "All", "robots": [robot.slug]}).data["slug"] == "all-2"
    service = manager("POST", "/service-accounts", {"name": "Me", "project": "Lab"})
    assert service.data["username"] == "me-2"


def test_a_robot_looks_like_no_other(robot: Robot, manager: Caller) -> None:
    register = {"profile": "tiago", "master_uri": "http://127.0.0.1:7"}
    for name in ("ТIАGо 1", "TIAGo 1", "TIAGo  1", " tiago 1", "ＴＩＡＧｏ 1"):
        answer = manager("POST", "/registry", {"name": name, "slug": "other", **register})
        assert _refused(answer) == (400, "name_alike"), name


def test_only_a_changed_name_of_a_robot_is_judged(robot: Robot, tiago: RobotProfile, manager: Caller) -> None:
    namesake = Robot.objects.create(slug="old", name=robot.name, profile=tiago, master_uri="http://old:11311")

    def changed(**fields: Any) -> Any:
        etag = manager("GET", "/registry/old").headers["ETag"]
        return manager("PATCH", "/registry/old", fields, If_Match=etag)

    moved = changed(name=robot.name, master_uri=" http://new:11311\u00a0")
    assert (moved.status_code, moved.data["master_uri"]) == (200, "http://new:11311")
    assert _refused(changed(name=robot.name.upper())) == (400, "name_alike")
    assert changed(name="TIAGo 2").status_code == 200
    namesake.refresh_from_db()
    assert namesake.name == "TIAGo 2"
    assert changed(name="TIAGO 2").status_code == 200  # it may be like its own name


ACCOUNTS = {
    "console": "name_reserved",
    "me": "name_reserved",
    "zora": None,
    "оperator": "name_mixed",
    "OPERATOR": "name_taken",
}


@pytest.mark.parametrize(("username", "code"), ACCOUNTS.items())
def test_the_admin_refuses_names_of_accounts(
    username: str, code: str | None, operator: User, staff: User, signed_in: Callable[[User], Client]
) -> None:
    fields = {"username": username, "usable_password": "false", "full_name": "", "email": ""}
    answer = signed_in(staff).post("/admin/accounts/user/add/", fields)
    made = User.objects.filter(username=username).exists()
    assert made is (code is None)
    if code:
        [fault] = answer.context["adminform"].form.errors.as_data()["username"]
        assert fault.code in (code, "unique")


@pytest.mark.parametrize(
    "full_name", ["Olga\u202e Operator", "Оlga Operator", "OIga Operator", "the console"]
)
def test_the_admin_refuses_full_names(
    full_name: str, operator: User, staff: User, signed_in: Callable[[User], Client]
) -> None:
    fields = {"username": "zora", "usable_password": "false", "full_name": full_name, "email": ""}
    answer = signed_in(staff).post("/admin/accounts/user/add/", fields)
    assert list(answer.context["adminform"].form.errors) == ["full_name"]


def test_lists_of_people_leave_out_refused_names(
    robot: Robot, operator: User, staff: User, manager: Caller
) -> None:
    manager("POST", "/courses", {"name": "HRI", "robots": [robot.slug], **TERM})
    people = "Оlga Operator <a@example.org>\nNíkos Quill <n@example.org>\nOlga Operator <o@example.org>\n"
    people += "Eve\u202e Night <e@example.org>\n"
    answer = manager("POST", "/courses/hri/members", {"list": people})
    assert [one["line"] for one in answer.data["wrong"]] == [1, 4]
    assert answer.data["wrong"][1]["reason"].startswith("Eve\\u202e Night: There is a line end")
    assert [one["name"] for one in answer.data["new"]] == ["Níkos Quill", "Olga Operator"]  # a namesake
    assert not User.objects.filter(email="a@example.org").exists()


@pytest.mark.django_db
def test_single_sign_on_takes_no_refused_user_name(operator: User) -> None:
    for name in ("console", "оperator"):
        with pytest.raises(ValidationError):
            AccountAdapter().clean_username(name)
    assert AccountAdapter().clean_username("zora") == "zora"


def test_an_old_name_may_stay(operator: User) -> None:
    User.objects.filter(pk=operator.pk).update(username="me")
    old = User.objects.get(pk=operator.pk)
    old.full_name = "Olga"
    old.clean()
    old.username = "none"
    with pytest.raises(ValidationError):
        old.clean()
