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
LAYOUT = {"robot": "tiago-1", "cells": "camera,map,scene", "side": "false"}
PLACES = {"chart": "top", "motions": "left", "phrases": "bottom"}

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
    assert client.post(KEEP, PLACES).status_code == 204
    assert client.post(KEEP, {"hints_seen": "true"}).status_code == 204
    assert client.post(KEEP, {"vibration": "false"}).status_code == 204
    assert client.post(KEEP, LAYOUT).status_code == 204
    assert client.post(KEEP, {"robot": "tiago-1", "plot": "/odom twist.linear.x"}).status_code == 204
    assert Record.objects.count() == records  # not recorded: nobody else is concerned
    other = Client()
    other.force_login(operator)
    assert shown(other, robot) == {
        "panels": PLACES,
        "hints_seen": True,
        "vibration": False,
        "layout tiago-1": {"cells": "camera,map,scene", "side": "false"},
        "plot tiago-1": {"plot": "/odom twist.linear.x"},
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
        {"chart": "top"},
        {**PLACES, "chart": "left"},
        {**PLACES, "chart": "ceiling"},
        {**PLACES, "chart": "x" * 10_000},
        {**LAYOUT, "robot": ""},
        {"robot": "tiago-1", "plot": "x" * 501},
        {**LAYOUT, "side": ""},
        {**LAYOUT, "cells": "camera,camera"},
        {**LAYOUT, "cells": "camera,hologram"},
        {**LAYOUT, "cells": "camera,plan,map,scene,second"},
    ],
)
def test_bad_choices_change_nothing(client: Client, operator: User, fields: dict[str, str]) -> None:
    client.force_login(operator)
    client.post(KEEP, PLACES)
    answer = client.post(KEEP, fields)
    assert answer.status_code == 400
    assert answer.json()["code"] == "bad_choice"
    assert answer.json()["text"]
    operator.refresh_from_db()
    assert operator.page_choices == {"panels": PLACES}


def test_an_account_keeps_no_flood_of_layouts(client: Client, operator: User) -> None:
    operator.page_choices = {f"layout robot-{n}": {} for n in range(200)}
    operator.save()
    client.force_login(operator)
    assert client.post(KEEP, {**LAYOUT, "robot": "robot-7"}).status_code == 204
    assert client.post(KEEP, LAYOUT).status_code == 400


def test_a_stranger_or_another_site_keeps_nothing(operator: User) -> None:
    assert Client().post(KEEP, PLACES, headers={"accept": "application/json"}).status_code == 401
    careful = Client(enforce_csrf_checks=True)
    careful.force_login(operator)
    assert careful.post(KEEP, PLACES).status_code == 403
    operator.refresh_from_db()
    assert operator.page_choices == {}
