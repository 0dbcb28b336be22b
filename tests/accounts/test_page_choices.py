"""The choices of a person about the control page: kept with the account, for every browser."""

from __future__ import annotations

import json
import re
from html import unescape
from typing import Any

import pytest
from django.test import Client

from fleet.accounts.models import User
from fleet.accounts.services import account_close
from fleet.audit.models import Record
from robots.registry.models import Robot

KEEP = "/accounts/settings/page/"
CELLS = ["camera", "map", "plot /odom twist.linear.x"]
LAYOUT = {"robot": "tiago-1", "layout": json.dumps({"cells": CELLS, "side": False})}
HINTS = {"hints_seen": "true"}


def laid_out(**changes: object) -> dict[str, str]:
    return {"robot": "tiago-1", "layout": json.dumps({"cells": CELLS, **changes})}


pytestmark = pytest.mark.django_db


def shown(client: Client, robot: Robot) -> Any:
    """The choices that the control page has for its script."""
    page = client.get(f"/robots/{robot.slug}/").content.decode()
    found = re.search('data-choices="([^"]*)"', page)
    assert found
    return json.loads(unescape(found.group(1)))


def test_choices_are_kept_for_every_browser_of_the_person(
    client: Client, operator: User, staff: User, robot: Robot
) -> None:
    client.force_login(operator)
    assert shown(client, robot) == {}
    records = Record.objects.count()
    assert client.post(KEEP, HINTS).status_code == 204
    assert client.post(KEEP, {"vibration": "false"}).status_code == 204
    assert client.post(KEEP, LAYOUT).status_code == 204
    assert Record.objects.count() == records  # not recorded: nobody else is concerned
    other = Client()
    other.force_login(operator)
    assert shown(other, robot) == {
        "hints_seen": True,
        "vibration": False,
        "layout tiago-1": {"layout": LAYOUT["layout"]},
    }
    other.force_login(staff)
    assert shown(other, robot) == {}
    account_close(user=operator)
    operator.refresh_from_db()
    assert operator.page_choices == {}


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"hints_seen": ""},
        {"unknown": "x" * 10_000},
        {**LAYOUT, "robot": ""},
        {**LAYOUT, "layout": "{"},
        {**LAYOUT, "layout": "[" * 10_000},
        laid_out(side="no"),
        laid_out(cells=["camera", "camera"]),
        laid_out(cells=["hologram"]),
        laid_out(cells=["plot " + "x" * 500]),
        laid_out(cells=["plot", "plot", "plot", "plot", "plot"]),
        laid_out(panels=["chart", "motions", "ceiling"]),
        laid_out(panels=["chart", "motions", "motions"]),
        laid_out(unknown=1),
    ],
)
def test_bad_choices_change_nothing(client: Client, operator: User, fields: dict[str, str]) -> None:
    client.force_login(operator)
    client.post(KEEP, HINTS)
    answer = client.post(KEEP, fields)
    assert answer.status_code == 400
    assert answer.json()["code"] == "bad_choice"
    assert answer.json()["text"]
    operator.refresh_from_db()
    assert operator.page_choices == {"hints_seen": True}


def test_an_account_keeps_no_flood_of_layouts(client: Client, operator: User) -> None:
    operator.page_choices = {f"layout robot-{n}": {} for n in range(200)}
    operator.save()
    client.force_login(operator)
    assert client.post(KEEP, {**LAYOUT, "robot": "robot-7"}).status_code == 204
    assert client.post(KEEP, LAYOUT).status_code == 400


def test_a_stranger_or_another_site_keeps_nothing(operator: User) -> None:
    assert Client().post(KEEP, HINTS, headers={"accept": "application/json"}).status_code == 401
    careful = Client(enforce_csrf_checks=True)
    careful.force_login(operator)
    assert careful.post(KEEP, HINTS).status_code == 403
    operator.refresh_from_db()
    assert operator.page_choices == {}
