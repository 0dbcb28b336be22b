"""The demo's door: one press signs in with an account of the demo's file. The console itself has no such door."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from django.test import Client

from script.stack.door.settings import ROOT_URLCONF, TEMPLATES
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db
DOOR = "/accounts/sign-in/demo/"


@pytest.fixture
def demo(settings: Any, tmp_path: Path, operator: object) -> Client:
    """A browser at the sign-in page of a demo whose file has the operator's password, and one that is out of date."""
    (tmp_path / "passwords.txt").write_text(f"operator {PASSWORD.replace(' ', '')}\nstaff outdated\n")
    settings.FLEET_VAR, settings.ROOT_URLCONF, settings.TEMPLATES = tmp_path, ROOT_URLCONF, TEMPLATES
    return Client()


def test_one_press_signs_in_and_leads_on(demo: Client, operator: Any, staff: Any) -> None:
    operator.set_password(PASSWORD.replace(" ", ""))
    operator.save()
    page = demo.get("/accounts/sign-in/?next=/plan/").text
    assert "Demo: sign in as" in page
    assert [f'value="{role}"' in page for role in ("staff", "supervisor", "operator", "observer")] == [
        True
    ] * 4
    assert demo.post(DOOR, {"name": "staff"}).status_code == 200  # the page again: another password now
    assert demo.post(DOOR, {"name": "stranger"}).status_code == 200
    assert "_auth_user_id" not in demo.session
    assert demo.post(DOOR, {"name": "operator", "next": "/plan/"}).headers["Location"] == "/plan/"
    assert demo.session["_auth_user_id"] == str(operator.pk)


def test_the_console_has_no_door(operator: object) -> None:
    stranger = Client()
    assert "Demo" not in stranger.get("/accounts/sign-in/").text
    assert stranger.post(DOOR, {"name": "operator"}).status_code == 404
