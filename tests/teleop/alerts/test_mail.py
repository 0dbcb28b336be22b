"""Letters about alerts through a real SMTP server, and what the console says while the server takes none."""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import closing
from datetime import timedelta
from email import message_from_bytes, policy
from email.message import EmailMessage
from pathlib import Path
from typing import Any

import pytest
from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult
from django.test import Client
from django.urls import reverse
from django.utils import timezone

from fleet.accounts import emails
from fleet.accounts.models import User
from fleet.base.environment import Environment, email
from fleet.bookings.models import Notification
from robots.registry.models import Robot
from script.stack.certificates import certificate_for
from teleop.alerts import checks
from teleop.alerts.watch import AlertWatch
from teleop.models import Alert, AlertRule
from tests.processes import free_port, until
from tests.teleop.alerts.test_alerts import NOW, Watched

send_at_once = emails.send_at_once  # `Watched` replaces it
PASSWORD = "p@ss/word"
WAIT_S = 10.0


class MailServer:
    """A server that wants TLS and a password, as those of most institutions. `letters`: what it took."""

    def __init__(self, folder: Path, settings: Any, patch: pytest.MonkeyPatch) -> None:
        self.letters: list[EmailMessage] = []
        self.port = free_port()
        self._settings, self._patch = settings, patch
        files = certificate_for(["127.0.0.1"], folder)
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        context.load_cert_chain(files.certificate, files.private_key)
        self.authority = str(files.authority)
        wants = {"tls_context": context, "require_starttls": True, "auth_required": True}
        self.controller = Controller(self, "127.0.0.1", self.port, authenticator=self._knows, **wants)

    def _knows(self, _server: Any, _session: Any, _envelope: Any, _mechanism: str, login: Any) -> AuthResult:
        known = (login.login, login.password) == (b"robots", PASSWORD.encode())
        return AuthResult(success=known, handled=False)  # the server says 535

    async def handle_DATA(self, _server: Any, _session: Any, envelope: Any) -> str:
        self.letters.append(message_from_bytes(envelope.content, policy=policy.default))  # type: ignore[arg-type]
        return "250 OK"

    def use(self, url: str = "", *, authority: str | None = None) -> None:
        """Give the console this mail server, by default in the way of docs/settings.md."""
        url = url or f"smtp://robots:p%40ss%2Fword@127.0.0.1:{self.port}"
        self._patch.setenv("SSL_CERT_FILE", self.authority if authority is None else authority)
        for name, value in email(Environment({"FLEET_EMAIL_URL": url})).items():
            setattr(self._settings, name, value)

    def subjects(self, count: int) -> list[str]:
        """Wait for so many letters, and return their subjects."""
        until(lambda: len(self.letters) >= count, f"{count} letters", WAIT_S)
        return [str(one["Subject"]) for one in self.letters]


@pytest.fixture
def server(tmp_path: Path, settings: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[MailServer]:
    settings.DEFAULT_FROM_EMAIL = '"Robots, Lab" <robots@lab.example>'
    monkeypatch.setattr(emails, "_note", lambda _addresses, _refused_at: None)  # another thread's database
    monkeypatch.setattr(emails, "_why_not", "")
    monkeypatch.setattr(emails, "AGAIN_S", (600.0,))
    server = MailServer(tmp_path / "tls", settings, monkeypatch)
    server.controller.start()
    yield server
    server.use()
    with emails._works:
        emails._works.notify_all()  # what still waits leaves now, and not in another test
    for thread in [one for one in threading.enumerate() if one.name == "email"]:
        thread.join(WAIT_S)
    server.controller.stop()


@pytest.fixture
def watched(server: MailServer, monkeypatch: pytest.MonkeyPatch, robot: Robot, staff: User) -> Watched:
    User.objects.filter(pk=staff.pk).update(email="sam@lab.example", language="es")
    found = Watched(monkeypatch, robot)
    monkeypatch.setattr(emails, "send_at_once", send_at_once)
    return found


def test_letters_arrive_by_starttls_in_the_readers_language(
    server: MailServer, watched: Watched, settings: Any
) -> None:
    AlertRule.objects.create(kind="bridge", after_min=2, again_h=1, quiet_from="12:00", quiet_until="13:00")
    settings.FLEET_ORIGINS = ["https://fleet.lab.example"]
    server.use()
    watched.look(0)
    watched.look(2)
    assert server.subjects(1) == ["TIAGo 1 is gone"]
    letter = server.letters[0]
    assert (letter["From"], letter["To"]) == ('"Robots, Lab" <robots@lab.example>', "sam@lab.example")
    assert "Desde 2026-11-30 10:00 UTC." in letter.get_content()
    assert "quién recibe estos correos" in letter.get_content()
    watched.look(63)
    assert server.subjects(2)[1] == "Continúa: TIAGo 1 is gone"
    watched.look(124)  # in quiet times
    watched.look(181)
    assert server.subjects(3)[2] == "Continúa: TIAGo 1 is gone"
    watched.there = False
    watched.look(183)
    assert server.subjects(4)[3] == "Terminado: TIAGo 1 is gone"


def refuses_the_password(server: MailServer) -> None:
    server.use(f"smtp://robots:wrong@127.0.0.1:{server.port}")


def has_an_unknown_authority(server: MailServer) -> None:
    server.use(authority="/nowhere")


def wants_tls(server: MailServer) -> None:
    server.use(f"smtp://127.0.0.1:{server.port}")


def is_away(server: MailServer) -> None:
    server.use(f"smtp://127.0.0.1:{free_port()}")


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (refuses_the_password, "535"),
        (has_an_unknown_authority, "certificate verify failed"),
        (wants_tls, "STARTTLS"),
        (is_away, "Connection refused"),
    ],
)
def test_staff_read_why_no_letter_leaves_and_a_test_sends_what_waits(
    server: MailServer, watched: Watched, client: Client, staff: User, fault: Any, words: str
) -> None:
    fault(server)
    watched.watch._checks[("mail",)] = checks.mail
    watched.look(0)
    watched.look(2)
    until(emails.why_none_leaves, "the letter does not leave", WAIT_S)
    watched.look(2.25)
    assert words in Alert.objects.get(kind="mail").words
    client.force_login(staff)
    page = client.get("/status/").content.decode()
    assert "no acepta correos" in page
    assert words in client.get(reverse("mail")).content.decode()
    server.use()
    tested = client.post(reverse("mail"), {"to": "me@lab.example"}).content.decode()
    assert "me@lab.example" in tested and words not in tested
    assert "TIAGo 1 is gone" in server.subjects(2)
    watched.look(3.5)
    assert not Alert.objects.filter(kind="mail", over_at=None).exists()


def test_a_server_that_hangs_holds_up_nothing(
    server: MailServer, watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emails, "SERVER_TIMEOUT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        server.use(f"smtp://127.0.0.1:{silent.getsockname()[1]}")
        watched.look(0)
        watched.look(2)
        caller, _ = silent.accept()
        with closing(caller):
            assert emails.why_none_leaves() == ""  # the round ended while the letter waits
            until(emails.why_none_leaves, "the letter does not leave", WAIT_S)
    assert "timed out" in emails.why_none_leaves()


def test_a_restart_with_other_settings_writes_again_what_waited(
    server: MailServer, watched: Watched, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_away(server)
    watched.watch._checks[("mail",)] = checks.mail
    watched.look(0)
    watched.look(2)
    until(emails.why_none_leaves, "the letter does not leave", WAIT_S)
    watched.look(2.25)
    monkeypatch.setattr(emails, "_why_not", "")  # of the new process
    server.use()
    restarted = AlertWatch()
    restarted._checks = watched.watch._checks
    restarted.look(NOW + timedelta(minutes=5))
    assert server.subjects(1) == ["TIAGo 1 is gone"]
    restarted.look(NOW + timedelta(minutes=6))
    assert Alert.objects.get(kind="bridge").mails == 1


def test_an_e_mail_about_a_booking_that_waits_long_is_found(
    server: MailServer, settings: Any, operator: User
) -> None:
    server.use()
    User.objects.filter(pk=operator.pk).update(email="olga@lab.example")
    one = Notification.objects.create(person=operator, subject="Slot", text="", made_at=timezone.now())
    assert list(checks.mail()) == []
    Notification.objects.update(made_at=timezone.now() - timedelta(minutes=31))
    (trouble,) = checks.mail()
    assert "have waited for 31 min" in trouble.words
    Notification.objects.filter(pk=one.pk).update(sent_at=timezone.now())
    assert list(checks.mail()) == []


def test_staff_without_an_address_read_that_nobody_gets_letters(
    server: MailServer, client: Client, staff: User
) -> None:
    server.use()
    client.force_login(staff)
    words = "Nobody of the staff has an e-mail address"
    for page in ("/status/", "/status/rules/"):
        assert words in client.get(page).content.decode()
    User.objects.filter(pk=staff.pk).update(email="sam@lab.example")
    assert words not in client.get("/status/").content.decode()
