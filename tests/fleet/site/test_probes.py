"""Probes for monitors without an account: does the process answer, and can it work?"""

from __future__ import annotations

from unittest import mock

import pytest
from django.db import DatabaseError
from django.test import Client

from fleet.site.pages import views

pytestmark = pytest.mark.django_db


@pytest.mark.parametrize("address", ["/livez", "/readyz", "/healthz"])
def test_monitors_need_no_account(address: str) -> None:
    assert Client().get(address).status_code == 200
    assert Client().head(address).status_code == 200
    assert Client().post(address).status_code == 405


@pytest.mark.parametrize(
    "fault", [{"side_effect": DatabaseError}, {"return_value": "2 migrations are not applied."}]
)
def test_a_process_that_cannot_work_is_alive_and_not_ready(fault: dict[str, object]) -> None:
    with mock.patch.object(views, "_trouble", autospec=True, **fault):
        ready = Client().get("/readyz")
        assert (ready.status_code, ready.json()["ok"]) == (503, False)
        assert Client().get("/livez").status_code == 200
