"""Second factors: people add an authenticator app and recovery codes; a setting requires them of staff."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from allauth.mfa.models import Authenticator
from allauth.mfa.recovery_codes.internal.auth import RecoveryCodes
from allauth.mfa.totp.internal import auth
from channels.testing import WebsocketCommunicator
from django.conf import settings
from django.core.management import CommandError, call_command
from django.db import connection
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.sign_in import throttle
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from fleet.audit.models import Record
from fleet.site.asgi import application
from robots.registry.models import Robot
from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db(transaction=True)

SIGN_IN = "/accounts/sign-in/"
CODE = "/accounts/second-factor/authenticate/"
SECRET = "JBSWY3DPEHPK3PXPJBSWY3DPEHPK3PXP"
HTML = {"headers": {"accept": "text/html"}}


def code_of(secret: str) -> str:
    return str(
        auth.format_hotp_value(auth.hotp_value(secret, next(iter(auth.yield_hotp_counters_from_time()))))
    )


def password_typed(name: str) -> Client:
    """Return a browser after the first step of a sign-in."""
    client = Client()
    assert client.post(SIGN_IN, {"username": name, "password": PASSWORD}).headers["Location"] == CODE
    return client


@pytest.fixture
def guarded(operator: User) -> User:
    """A person with an authenticator app and recovery codes."""
    auth.TOTP.activate(operator, SECRET)
    RecoveryCodes.activate(operator)
    return operator


def test_an_app_is_set_up_and_then_asked_for(operator: User, signed_in: Callable[[User], Client]) -> None:
    client = signed_in(operator)
    start = "/accounts/second-factor/totp/activate/"
    asked = client.get(start).headers["Location"]
    assert asked.startswith("/accounts/again/")
    client.post(asked, {"password": PASSWORD})
    secret = client.get(start).context["form"].secret
    assert client.post(start, {"code": "000000"}).status_code == 200
    assert not Authenticator.objects.exists()
    assert client.post(start, {"code": code_of(secret)}).status_code == 302
    added = Record.objects.filter(kind="account.second_factor", outcome="added", actor_id=str(operator.pk))
    assert {record.parameters["factor"] for record in added} == {"totp", "recovery_codes"}
    stored = Authenticator.objects.get(type="totp").data["secret"]
    assert secret not in stored
    later = password_typed("operator")
    assert later.get("/accounts/", **HTML).status_code == 302  # not signed in yet
    auth.cache.clear()  # forget that the form before has just used this code
    assert later.post(CODE, {"code": code_of(secret)}).headers["Location"] == "/"
    assert later.get("/accounts/").status_code == 200
    newest = Record.objects.filter(kind="account.sign_in").latest("id")
    assert newest.parameters == {"by": ["password", "totp"]}


def test_a_code_is_good_once_whichever_web_process_sees_it(guarded: User) -> None:
    code = code_of(SECRET)
    assert password_typed(guarded.username).post(CODE, {"code": code}).status_code == 302
    again = (
        "from allauth.mfa.models import Authenticator; from allauth.mfa.totp.internal.auth import TOTP;"
        f"print(TOTP(Authenticator.objects.get(type='totp')).validate_code({code!r}))"
    )
    database = connection.settings_dict
    url = f"sqlite:///{database['NAME']}"
    if connection.vendor == "postgresql":
        url = os.environ["FLEET_DATABASE_URL"].replace("/postgres?", f"/{database['NAME']}?")
    said = subprocess.run(  # our own program
        [sys.executable, "manage.py", "shell", "--no-imports", "-c", again],
        cwd=settings.BASE_DIR,
        env=os.environ | {"FLEET_DATABASE_URL": url, "DJANGO_SETTINGS_MODULE": "fleet.settings"},
        check=True,
        capture_output=True,
        text=True,
    )
    assert said.stdout.strip() == "False"


def test_a_recovery_code_works_once(guarded: User) -> None:
    code = Authenticator.objects.get(type="recovery_codes").wrap().get_unused_codes()[0]
    assert password_typed("operator").post(CODE, {"code": code}).headers["Location"] == "/"
    assert "Incorrect code" in password_typed("operator").post(CODE, {"code": code}).content.decode()


def test_wrong_codes_are_counted_whatever_the_address(guarded: User) -> None:
    for number in range(throttle.FAILURES):
        client = password_typed("operator")
        client.post(CODE, {"code": "000000"}, REMOTE_ADDR=f"10.0.0.{number}")
    answer = password_typed("operator").post(CODE, {"code": code_of(SECRET)}, REMOTE_ADDR="10.0.1.1")
    assert "Too many failed attempts" in answer.content.decode()
    tried = Record.objects.filter(kind="account.sign_in_failed")
    assert {record.parameters["user"] for record in tried} == {str(guarded.pk)}
    assert Client().post(SIGN_IN, {"username": "operator", "password": PASSWORD}).status_code == 302


def test_codes_of_another_key_fit_no_more(guarded: User, settings: Any) -> None:
    """A changed FLEET_SECRET_KEY makes stored secrets unreadable: no code fits, not even of an empty secret."""
    settings.SECRET_KEY = "another key of this console, long enough"
    for code in (code_of(SECRET), code_of("")):
        assert "Incorrect code" in password_typed("operator").post(CODE, {"code": code}).content.decode()


@pytest.mark.parametrize("credential", ["", "{}", "[1]", '"x"', '{"id": 1, "rawId": null}', "no json"])
def test_a_broken_passkey_is_refused_in_words(guarded: User, credential: str) -> None:
    assert password_typed("operator").post(CODE, {"credential": credential}).status_code == 200
    alone = Client().post("/accounts/second-factor/webauthn/login/", {"credential": credential})
    assert alone.headers["Location"] == SIGN_IN


def test_staff_must_have_one_where_the_setting_asks(
    staff: User, operator: User, signed_in: Callable[[User], Client], settings: Any
) -> None:
    client = signed_in(staff)
    assert client.get("/", **HTML).status_code == 200
    settings.FLEET_STAFF_TWO_FACTOR = True
    for page in ("/", "/admin/", "/bookings/"):
        assert client.get(page, **HTML).headers["Location"] == "/accounts/second-factor/"
    assert client.get("/api/v1/robots").json()["code"] == "second_factor_missing"
    assert client.get("/accounts/second-factor/").status_code == 200
    assert client.get("/accounts/", **HTML).status_code == 200
    assert client.get("/accounts/tokens/", **HTML).headers["Location"] == "/accounts/second-factor/"
    for stop in ("/stop-all/", "/api/v1/stop/", "/api/v1/robots/tiago-9/stop/"):
        assert client.post(stop, **HTML).status_code in (200, 202, 404, 503)  # a stop needs no second factor
    assert signed_in(operator).get("/", **HTML).status_code == 200
    app = auth.TOTP.activate(staff, SECRET).instance
    assert client.get("/admin/", **HTML).status_code == 200
    client.post("/accounts/again/", {"password": PASSWORD})
    client.post("/accounts/second-factor/totp/deactivate/")
    assert Authenticator.objects.filter(pk=app.pk).exists()  # staff must keep one


def test_a_token_is_no_way_around_it(staff: User, robot: Robot, settings: Any) -> None:
    expires = timezone.now() + timedelta(days=1)
    token, text = token_make(user=staff, name="laptop", scopes=[Scope.READ], expires_at=expires, actor=staff)
    program = Client(headers={"Authorization": f"Bearer {text}"})
    assert program.get("/api/v1/robots").status_code == 200
    settings.FLEET_STAFF_TWO_FACTOR = True
    answer = program.get("/api/v1/robots")
    assert (answer.status_code, answer.json()["code"]) == (401, "second_factor_missing")
    assert program.post("/api/v1/stop/").status_code in (200, 202, 503)  # a stop needs no second factor
    User.objects.filter(pk=token.user_id).update(project="Calibration")
    assert program.get("/api/v1/robots").status_code == 200  # a service account can have none


async def test_staff_without_one_open_no_websocket(
    staff: User,
    signed_in: Callable[[User], Client],
    websocket_headers: Callable[[Client], list[tuple[bytes, bytes]]],
    settings: Any,
) -> None:
    from asgiref.sync import sync_to_async

    settings.FLEET_STAFF_TWO_FACTOR = True
    headers = websocket_headers(await sync_to_async(signed_in)(staff))
    socket = WebsocketCommunicator(application, "/ws/fleet/", headers=headers)
    await socket.connect()
    closed = await socket.receive_output()
    assert (closed["code"], "second factor" in closed["reason"]) == (4401, True)


def test_staff_removes_the_factor_of_a_lost_phone(
    staff: User, guarded: User, signed_in: Callable[[User], Client]
) -> None:
    form = {"action": "remove_second_factors", "_selected_action": [str(guarded.pk)]}
    signed_in(staff).post("/admin/accounts/user/", form)
    assert not Authenticator.objects.exists()
    removed = Record.objects.filter(kind="account.second_factor", outcome="removed")
    assert {record.actor_id for record in removed} == {str(staff.pk)}
    assert Client().post(SIGN_IN, {"username": "operator", "password": PASSWORD}).headers["Location"] == "/"


def test_the_last_admin_gets_in_by_the_command_line(guarded: User) -> None:
    call_command("remove_second_factor", "operator")
    assert not Authenticator.objects.exists()
    assert Record.objects.filter(kind="account.second_factor", outcome="removed").count() == 2
    with pytest.raises(CommandError, match="has no second factor"):
        call_command("remove_second_factor", "operator")
