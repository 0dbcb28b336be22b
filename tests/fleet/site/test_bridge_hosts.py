"""*Add a bridge host*: a command with a code that works once, and the settings and certificate for it."""

from __future__ import annotations

import json
import re
import socket
import ssl
import threading
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from django.conf import settings
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.link.connections import _tls
from robots.registry.bridge_hosts import free_addresses
from robots.registry.models import BridgeHost, Robot
from robots.shared.configuration.bridge_config import LinkAddress

pytestmark = pytest.mark.django_db
SignIn = Callable[[User], Client]
ADD, LIST, JOIN = "/admin/robots/bridgehost/add/", "/admin/robots/bridgehost/", "/bridge-hosts/join/"
URL = "postgresql://fleet:secret@db.lab.example/fleet"


@pytest.fixture
def reachable(monkeypatch: pytest.MonkeyPatch, settings: Any) -> None:
    """Settings with which other computers can run bridges."""
    database = settings.DATABASES["default"]
    monkeypatch.setitem(database, "ENGINE", "django.db.backends.postgresql")
    monkeypatch.setitem(database, "HOST", "db.lab.example")
    monkeypatch.setenv("FLEET_DATABASE_URL", URL)
    settings.FLEET_LINK_SECRET = "of both sides, thirty-two characters"
    settings.FLEET_LINK_CA = None
    settings.FLEET_TLS = True


@pytest.fixture
def command(reachable: None, signed_in: SignIn, staff: User) -> str:
    """The command of a new bridge host, from its page."""
    page = signed_in(staff).post(ADD, {"name": "Localhost"}, secure=True).text
    return re.search(r"<pre[^>]*>(.*?)</pre>", page)[1]


def asked(command: str, key: ec.EllipticCurvePrivateKey | None = None) -> Any:
    """Send the code of the command as another computer does."""
    key = key or ec.generate_private_key(ec.SECP256R1())
    request = x509.CertificateSigningRequestBuilder().subject_name(x509.Name([])).sign(key, hashes.SHA256())
    pem = request.public_bytes(serialization.Encoding.PEM).decode()
    body = json.dumps({"code": command.split()[-1], "certificate_request": pem})
    return Client().post(JOIN, body, content_type="application/json", secure=True)


def test_a_computer_joins_once_with_the_command(command: str, tmp_path: Path) -> None:
    assert re.fullmatch(
        r"sudo script/install-service bridges --join https://testserver\S+ [0-9a-f]{40}", command
    )
    key = ec.generate_private_key(ec.SECP256R1())
    joined = asked(command, key).json()
    assert joined["settings"] == {
        "FLEET_BRIDGE_HOST": "localhost",
        "FLEET_DATABASE_URL": URL,
        "FLEET_LINK_SECRET": settings.FLEET_LINK_SECRET,
    }
    assert_web_processes_trust(joined["certificate"], key, tmp_path)
    assert free_addresses() == ["wss://localhost:7443"]
    again = asked(command)
    assert again.status_code == 403 and "wrong, used or too old" in again.json()["text"]
    assert [record.kind for record in Record.objects.filter(kind__startswith="host.").order_by("id")] == [
        "host.code",
        "host.join",
    ]
    code = command.split()[-1]
    assert code not in str(BridgeHost.objects.values().get())  # only its digest is kept
    assert code not in str(list(Record.objects.values()))


def assert_web_processes_trust(certificate: str, key: ec.EllipticCurvePrivateKey, directory: Path) -> None:
    """Do a handshake as between a web process and a bridge."""
    pem = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    (directory / "both.pem").write_text(pem.decode() + certificate)
    bridge = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    bridge.load_cert_chain(directory / "both.pem")
    ours, theirs = socket.socketpair()
    thread = threading.Thread(target=lambda: bridge.wrap_socket(theirs, server_side=True).close())
    thread.start()
    web = _tls(LinkAddress(host="localhost", port=7443))
    with web.wrap_socket(ours, server_hostname="localhost") as link:
        assert link.version()
    thread.join()


def test_a_removed_host_is_said_to_know_secrets(command: str, signed_in: SignIn, staff: User) -> None:
    assert asked(command).status_code == 200
    path = f"/admin/robots/bridgehost/{BridgeHost.objects.get().pk}/delete/"
    page = signed_in(staff).post(path, {"post": "yes"}, secure=True, follow=True).text
    assert "The computer localhost still knows the database&#x27;s password and FLEET_LINK_SECRET" in page
    assert not BridgeHost.objects.exists()


def test_a_code_that_is_too_old_is_refused(command: str) -> None:
    BridgeHost.objects.update(code_until=timezone.now() - timedelta(seconds=1))
    assert asked(command).status_code == 403
    assert BridgeHost.objects.get().joined_at is None


def test_only_who_has_the_code_is_told_what_is_missing(command: str, settings: Any) -> None:
    settings.FLEET_TLS = False
    refused = asked("guess")
    assert refused.status_code == 403 and "FLEET_TLS" not in refused.text
    refused = asked(command)
    assert refused.status_code == 409 and "FLEET_TLS is off" in refused.json()["text"]
    settings.FLEET_TLS = True
    assert asked(command).status_code == 200


def test_a_new_command_ends_the_old_one(command: str, signed_in: SignIn, staff: User) -> None:
    chosen = [str(BridgeHost.objects.get().pk)]
    page = signed_in(staff).post(LIST, {"action": "make_command", "_selected_action": chosen}, secure=True)
    assert asked(command).status_code == 403
    assert asked(re.search(r"<pre[^>]*>(.*?)</pre>", page.text)[1]).status_code == 200


def test_guesses_are_limited(command: str) -> None:
    statuses = [asked(f"guess-{number}").status_code for number in range(11)]
    assert statuses == [403] * 10 + [429]


def test_what_is_no_request_uses_no_code(command: str) -> None:
    body = json.dumps({"code": command.split()[-1], "certificate_request": "none"})
    assert Client().post(JOIN, body, content_type="application/json", secure=True).status_code == 403
    assert Client().post(JOIN, b"[", content_type="application/json", secure=True).status_code == 403
    assert asked(command).status_code == 200


def test_the_page_says_why_no_other_computer_can_join(
    reachable: None, signed_in: SignIn, staff: User, operator: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = signed_in(staff)
    assert "<pre" not in client.get(ADD, secure=True).text
    monkeypatch.setitem(settings.DATABASES["default"], "HOST", "127.0.0.1")
    assert "names a database on this computer" in client.get(ADD, secure=True).text
    monkeypatch.setitem(settings.DATABASES["default"], "ENGINE", "django.db.backends.sqlite3")
    assert "The database is SQLite" in client.get(ADD, secure=True).text
    assert signed_in(operator).get(ADD, secure=True).status_code == 302


def test_a_robot_form_names_free_addresses(signed_in: SignIn, staff: User, robot: Robot) -> None:
    BridgeHost.objects.create(name="arm.lab.example", joined_at=timezone.now())
    Robot.objects.update(bridge_address="wss://arm.lab.example:7443")
    page = signed_in(staff).get(f"/admin/robots/robot/{robot.pk}/change/").text
    assert "Free: wss://arm.lab.example:7444" in page
