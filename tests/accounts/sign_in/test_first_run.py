"""A new installation is set up in the browser with a one-time code, and only once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from django.test import Client

from fleet.accounts.models import User
from fleet.accounts.sign_in import first_run
from fleet.audit.models import Record
from robots.registry.models import Robot, RobotProfile

pytestmark = pytest.mark.django_db
PASSWORD = "a long walk on the beach"


@pytest.fixture(autouse=True)
def own_directory(settings: Any, tmp_path: Path) -> None:
    settings.FLEET_VAR = tmp_path


def typed(code: str, **more: str) -> dict[str, str]:
    passwords = {"password1": PASSWORD, "password2": PASSWORD}
    return {"code": code, "username": "ada", "full_name": "Ada", "email": "", **passwords, **more}


def test_every_page_leads_to_setup_until_it_is_done(client: Client, tiago: RobotProfile) -> None:
    code = first_run.code_make()
    assert code is not None
    for page in ("/", "/accounts/sign-in/", "/admin/"):
        assert client.get(page).headers["Location"] == "/setup/"
    assert code not in (Path(first_run._file()).read_text())
    assert client.post("/setup/", typed("ABCD-EFGH-JKLM")).status_code == 403
    assert not User.objects.exists()
    assert (
        client.post("/setup/", typed(code.lower().replace("-", " "))).headers["Location"] == "/setup/robot/"
    )
    ada = User.objects.get()
    assert (ada.is_staff, ada.is_superuser, ada.check_password(PASSWORD)) == (True, True, True)
    assert Record.objects.get(kind="setup.admin").actor_id == str(ada.pk)
    entered = {"name": "TIAGo 42", "profile": str(tiago.pk), "master_uri": "http://127.0.0.1:9"}
    assert client.post("/setup/robot/", entered).headers["Location"] == "/setup/robot/tiago-42/"
    assert Robot.objects.get().name == "TIAGo 42"
    assert "Make a course" in client.get("/setup/people/").content.decode()


def test_the_code_ends_with_its_use(client: Client) -> None:
    code = first_run.code_make()
    assert code is not None
    client.post("/setup/", typed(code))
    again = Client().post("/setup/", typed(code, username="eve"))
    assert (again.status_code, User.objects.count()) == (403, 1)
    assert "set up" in again.content.decode()
    assert first_run.code_make() is None


def test_wrong_codes_are_limited(client: Client) -> None:
    code = first_run.code_make() or ""
    answers = [client.post("/setup/", typed("WRONG")).status_code for _ in range(11)]
    assert (answers[0], answers[-1]) == (403, 429)
    assert client.post("/setup/", typed(code)).status_code == 429


def test_a_code_waits_again_if_the_account_is_not_saved(client: Client, monkeypatch: Any) -> None:
    code = first_run.code_make() or ""
    client.raise_request_exception = False
    with monkeypatch.context() as patch:
        patch.setattr(first_run, "record", lambda *_words, **_more: 1 / 0)
        assert client.post("/setup/", typed(code)).status_code == 500
    assert client.post("/setup/", typed(code)).status_code == 302


def test_an_account_made_elsewhere_closes_the_page(client: Client, staff: User) -> None:
    first_run._file().write_text(first_run._digest("ABCD"))
    assert client.get("/setup/").status_code == 403
    assert not first_run._file().exists()


def test_later_steps_are_for_staff(client: Client, operator: User) -> None:
    client.force_login(operator)
    assert {client.get(f"/setup/{page}/").status_code for page in ("robot", "people")} == {403}


def test_staff_without_robots_are_led_to_add_one(client: Client, staff: User, stranger: User) -> None:
    client.force_login(staff)
    page = client.get("/").content.decode()
    assert 'href="/setup/robot/"' in page and "Ask a member of staff" not in page
    assert "There is no robot yet." in client.get("/today/").content.decode()
    client.force_login(stranger)
    assert "Ask a member of staff" in client.get("/").content.decode()
