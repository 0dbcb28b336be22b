"""Pushes to a real push service: encrypted for the browser, signed by the console, tried again, given up."""

from __future__ import annotations

import socket
import time
from base64 import urlsafe_b64decode
from datetime import timedelta

import jwt
import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from django.utils import timezone

from fleet.base.environment import WebhookAllow
from fleet.bookings.messages.notifications import notification_write, notifications_seen, passing_write
from fleet.bookings.models import Notification
from teleop.models import PushDelivery, PushSubscription
from teleop.push import delivery, services
from teleop.push.keys import from_b64, public_key
from teleop.push.worker import PushWorker
from tests.processes import until
from tests.teleop.push.conftest import Browser
from tests.teleop.webhooks.conftest import names  # noqa: F401

pytestmark = pytest.mark.django_db


@pytest.fixture
def device(operator, browser):
    return subscribe(operator, browser)


def subscribe(person, browser):
    facts = {"person": person, "endpoint": browser.endpoint, **browser.keys}
    return services.device_add(**facts, user_agent="Firefox/140.0 Linux", now=timezone.now())


def told(person, until_s=90, now=None):
    now = now or timezone.now()
    moment = {"path": "/robots/tiago-1/", "until": now + timedelta(seconds=until_s)}
    passing_write(to=person, subject="TIAGo 1: your turn", text="Take control ✓", now=now, **moment)


def send(person):
    PushDelivery.objects.update(due_at=timezone.now() - timedelta(seconds=1))
    return delivery.send_due(person.pk)


def test_a_push_is_encrypted_for_the_browser_and_signed(operator, observer, browser, device, service):
    told(observer)
    told(operator)
    assert delivery.people_due(timezone.now()) == [operator.pk]
    assert send(operator) == 1
    [(path, headers, body)] = service.heard
    assert path == "/push/1"
    assert browser.reads(body) == {
        "title": "TIAGo 1: your turn",
        "body": "Take control ✓",
        "path": "/robots/tiago-1/",
        "tag": str(Notification.objects.get(person=operator).pk),
    }
    assert 80 < int(headers["ttl"]) <= 90
    assert (headers["urgency"], headers["content-encoding"]) == ("high", "aes128gcm")
    token, key = (
        part.partition("=")[2] for part in headers["authorization"].removeprefix("vapid ").split(", ")
    )
    assert key == public_key()
    signer = ec.EllipticCurvePublicKey.from_encoded_point(ec.SECP256R1(), from_b64(key))
    origin = f"http://127.0.0.1:{service.server_port}"
    claims = jwt.decode(token, signer, algorithms=["ES256"], audience=origin)
    assert claims["sub"].startswith("mailto:")
    assert time.time() < claims["exp"] < time.time() + 24 * 60 * 60
    assert not PushDelivery.objects.exists()


def test_a_long_text_of_any_letters_fits(operator, browser, device, service):
    notification_write(to=operator, subject=300 * "😀", text=9000 * "😀", now=timezone.now())
    send(operator)
    [(_path, headers, body)] = service.heard
    assert len(body) <= 4096
    assert browser.reads(body)["path"] == "/bookings/mine/"
    assert headers["urgency"] == "normal"


@pytest.mark.parametrize("status", [404, 410])
def test_a_browser_that_is_gone_is_removed(operator, device, service, status):
    service.answers = [status]
    told(operator)
    told(operator)
    send(operator)
    assert not PushSubscription.objects.exists()
    assert not PushDelivery.objects.exists()
    told(operator)
    assert len(service.heard) == 1


def test_a_busy_service_is_asked_again_later(operator, device, service):
    service.answers = [503, 429]
    told(operator)
    for paused_s in (5, 30):
        send(operator)
        [waiting] = PushDelivery.objects.all()
        assert abs((waiting.due_at - timezone.now()).total_seconds() - paused_s) < 3
        assert delivery.send_due(operator.pk) == 0
    send(operator)
    assert not PushDelivery.objects.exists()
    assert len(service.heard) == 3


def test_what_is_over_or_seen_is_not_sent(operator, device, service):
    told(operator, now=timezone.now() - timedelta(seconds=100))
    told(operator)
    notifications_seen(operator, Notification.objects.latest("pk").pk, timezone.now())
    send(operator)
    assert service.heard == []
    assert not PushDelivery.objects.exists()


def test_a_device_to_which_nothing_arrives_is_removed(operator, device, service, monkeypatch):
    monkeypatch.setattr(delivery, "MOST_FAILURES", 2)
    service.answers = [403, 200, 403, 403]
    for left in (True, True, True, False):
        told(operator)
        send(operator)
        assert PushSubscription.objects.exists() is left


def test_a_device_stays_while_no_name_can_be_resolved(operator, device, monkeypatch):
    def unreachable(*_args, **_options):
        raise socket.gaierror

    monkeypatch.setattr(socket, "getaddrinfo", unreachable)
    told(operator)
    send(operator)
    assert PushDelivery.objects.get().tries == 1
    monkeypatch.undo()
    send(operator)
    assert not PushDelivery.objects.exists()


@pytest.mark.parametrize("address", ["10.0.0.7", "127.0.0.1", "::1"])
def test_a_name_that_leads_into_the_own_network_gets_nothing(operator, settings, service, names, address):  # noqa: F811
    settings.FLEET_PUSH_ALLOW = WebhookAllow()
    names["push.example.org"] = [address]
    subscribe(operator, Browser("https://push.example.org/1"))
    told(operator)
    send(operator)
    assert service.heard == []
    assert not PushSubscription.objects.exists()


@pytest.mark.django_db(transaction=True)
def test_housekeeping_sends_beside_a_service_that_hangs(operator, observer, browser, device, service):
    other = Browser(browser.endpoint.replace("/push/1", "/push/2"))
    subscribe(observer, other)
    over = []

    def hang(handler):
        if handler.path == "/push/1":
            until(lambda: over, "the other push")
        handler.send_response(201)
        handler.end_headers()

    service.acts = hang
    told(operator)
    told(observer)
    worker = PushWorker()
    worker.step()
    until(lambda: "/push/2" in [path for path, *_rest in service.heard], "the push beside it")
    over.append(True)
    until(lambda: not PushDelivery.objects.exists(), "all pushes")


def test_the_encryption_is_that_of_the_standard(monkeypatch):
    """The example of RFC 8291, section 5."""
    from teleop.push import encryption

    own = urlsafe_b64decode("yfWPiYE-n46HLnH0KqZOF1fJJU3MYrct3AELtAQ-oRw=")
    salt = urlsafe_b64decode("DGv6ra1nlYgDCS1FRnbzlw==")
    private = ec.derive_private_key(int.from_bytes(own, "big"), ec.SECP256R1())
    monkeypatch.setattr(encryption.ec, "generate_private_key", lambda _curve: private)
    monkeypatch.setattr(encryption.os, "urandom", lambda _length: salt)
    browser = from_b64(
        "BCVxsr7N_eNgVRqvHtD0zTZsEc6-VV-JvLexhqUzORcxaOzi6-AYWXvTBHm4bjyPjs7Vd8pZGH6SRpkNtoIAiw4"
    )
    body = encryption.encrypted_push(
        b"When I grow up, I want to be a watermelon", browser, from_b64("BTBZMqHH6r4Tts7J_aSIgg")
    )
    expected = (
        "DGv6ra1nlYgDCS1FRnbzlwAAEABBBP4z9KsN6nGRTbVYI_c7VJSPQTBtkgcy27mlmlMoZIIgDll6e3vCYLocInmYWAmS6TlzAC8wEqKK"
        "6PBru3jl7A_yl95bQpu6cVPTpK4Mqgkf1CXztLVBSt2Ks3oZwbuwXPXLWyouBWLVWGNWQexSgSxsj_Qulcy4a-fN"
    )
    assert body == from_b64(expected)
