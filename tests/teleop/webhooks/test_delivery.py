"""Deliveries to a real receiver: signed, claimed, retried, given up, limited in time."""

import base64
import datetime as dt
import hashlib
import hmac
import json
import os
import signal
import socket
import ssl
import subprocess
import sys
import threading
import time
from ipaddress import ip_address

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from django.db import connection
from django.utils import timezone

from fleet.audit.services import record
from fleet.base.environment import WebhookAllow
from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks import delivery, post, services
from teleop.webhooks.delivery import PAUSES, remove_old_deliveries, send_due
from teleop.webhooks.event_reader import EventReader
from teleop.webhooks.signature import signature
from teleop.webhooks.worker import WebhookWorker
from tests.processes import REPOSITORY, outside, until

pytestmark = pytest.mark.django_db

State = WebhookDelivery.State


def news(webhook, robot, number=1):
    for _ in range(number):
        record("control.take", robot_id=robot.id, robot_name=robot.name)
    EventReader().read(Webhook.objects.get(pk=webhook.pk))
    return list(webhook.deliveries.order_by("pk"))[-number:]


def answers_of(one):
    one.refresh_from_db()
    return one.answers


def make_due(one):
    WebhookDelivery.objects.filter(pk=one.pk).update(due_at=timezone.now())


def test_a_delivery_is_signed_as_standard_webhooks_are(make, robot, receiver):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    assert send_due(webhook.pk) == 1
    [(path, headers, body)] = receiver.heard
    assert (path, headers["host"]) == ("/fleet?lab=1", f"127.0.0.1:{receiver.server_port}")
    assert headers["content-type"] == "application/json; charset=utf-8"
    assert headers["webhook-id"] == f"rec_{one.record}" == json.loads(body)["id"]
    assert abs(int(headers["webhook-timestamp"]) - time.time()) < 5
    key = base64.b64decode(make.secret.removeprefix("whsec_"))
    signed = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
    expected = base64.b64encode(hmac.digest(key, signed, hashlib.sha256)).decode()
    assert headers["webhook-signature"] == f"v1,{expected}"
    assert make.secret not in webhook.secret
    [answer] = answers_of(one)
    assert (one.state, answer["status"], answer["text"]) == (State.DELIVERED, 200, "heard")
    assert send_due(webhook.pk) == 0


def test_the_known_example_of_the_specification():
    secret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
    body = b'{"test": 2432232314}'
    found = signature(secret, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330, body)
    assert found == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_500_and_then_200(make, robot, receiver):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    receiver.answers = [500]
    before = timezone.now()
    assert send_due(webhook.pk) == 1
    assert send_due(webhook.pk) == 0  # not yet
    one.refresh_from_db()
    assert (one.state, one.answers[0]["status"]) == (State.WAITING, 500)
    assert dt.timedelta(0) <= one.due_at - before - PAUSES[0] < dt.timedelta(seconds=5)
    make_due(one)
    send_due(webhook.pk)
    assert [answer["status"] for answer in answers_of(one)] == [500, 200]
    assert one.state == State.DELIVERED
    first, second = receiver.heard
    assert first[1]["webhook-id"] == second[1]["webhook-id"] and first[2] == second[2]


def test_pauses_grow_then_it_is_given_up_and_shown(make, robot, receiver, staff, signed_in):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    receiver.answers = [503] * 7
    waited = []
    for _ in range(6):
        send_due(webhook.pk)
        one.refresh_from_db()
        waited.append(round((one.due_at - timezone.now()).total_seconds(), -1))
        make_due(one)
    assert waited == [10, 60, 300, 1800, 7200, 43200]
    send_due(webhook.pk)
    assert len(answers_of(one)) == 7 and one.state == State.GIVEN_UP
    make_due(one)
    assert send_due(webhook.pk) == 0
    page = signed_in(staff)
    assert "1 given up" in page.get("/webhooks/").text
    assert "503" in page.get(f"/webhooks/{webhook.pk}/").text
    page.post(f"/webhooks/{webhook.pk}/", {"action": "again"})
    assert send_due(webhook.pk) == 1
    assert len(answers_of(one)) == 1 and one.state == State.DELIVERED


def test_a_redirect_is_not_followed(make, robot, receiver):
    def redirect(handler):
        handler.send_response(307)
        handler.send_header("Location", f"http://127.0.0.1:{receiver.server_port}/elsewhere\x00")
        handler.end_headers()

    receiver.acts = redirect
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    send_due(webhook.pk)
    [answer] = answers_of(one)
    assert answer["status"] == 307 and "not followed" in answer["text"] and "/elsewhere" in answer["text"]
    assert [path for path, _, _ in receiver.heard] == ["/fleet?lab=1"]


def test_a_receiver_that_hangs_costs_a_limited_time(make, robot, receiver, monkeypatch):
    monkeypatch.setattr(post, "STEP_S", 0.3)
    webhook, free = make(receiver.address), threading.Event()
    receiver.acts = lambda _handler: free.wait(10)
    first, second = news(webhook, robot, 2)
    begun = time.monotonic()
    assert send_due(webhook.pk) == 1  # the second waits for the next round
    assert time.monotonic() - begun < 4
    free.set()
    assert answers_of(first)[0]["code"] == "timeout"
    assert answers_of(second) == []


def test_an_answer_letter_by_letter_is_cut_off(make, robot, receiver, monkeypatch):
    monkeypatch.setattr(post, "WHOLE_S", 0.5)

    def drip(handler):
        for _ in range(100):
            handler.wfile.write(b"H")
            time.sleep(0.05)

    receiver.acts = drip
    receiver.handle_error = lambda *_args: None
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    begun = time.monotonic()
    send_due(webhook.pk)
    assert time.monotonic() - begun < 4
    assert answers_of(one)[0]["code"] == "timeout"


def test_of_an_endless_answer_only_the_beginning_is_read(make, robot, receiver):
    written = []

    def endless(handler):
        handler.send_response(200)
        handler.end_headers()
        for _ in range(2000):
            handler.wfile.write(b"\x00\xff<b>" * 8192)
            written.append(1)

    receiver.acts = endless
    receiver.handle_error = lambda *_args: None
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    send_due(webhook.pk)
    [answer] = answers_of(one)
    assert one.state == State.DELIVERED
    assert len(answer["text"]) == delivery.ANSWER_LENGTH and "\x00" not in answer["text"]
    until(lambda: len(receiver.heard) == 1, "one request")
    assert len(written) < 500


@pytest.mark.parametrize(
    ("said", "code"),
    [(b"SSH-2.0-OpenSSH\r\n", "no_http"), (b"", "no_http"), (b"HTTP/1.1 abc\r\n\r\n", "no_http")],
)
def test_a_receiver_without_http_is_named(said, code, make, robot, receiver):
    receiver.acts = lambda handler: handler.wfile.write(said)
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    send_due(webhook.pk)
    assert answers_of(one)[0]["code"] == code


def test_nobody_there(make, robot):
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    webhook = make(f"http://127.0.0.1:{port}/")
    [one] = news(webhook, robot)
    send_due(webhook.pk)
    assert answers_of(one)[0]["code"] == "no_connection"


# --- addresses ------------------------------------------------------------------------------------


def test_a_name_that_becomes_private_gets_no_request(make, robot, receiver, names, settings):
    names["ci.example"] = ["93.184.216.34"]
    webhook = make(f"https://ci.example:{receiver.server_port}/")
    [one] = news(webhook, robot)
    settings.FLEET_WEBHOOK_ALLOW = WebhookAllow()
    names["ci.example"] = ["127.0.0.1"]
    send_due(webhook.pk)
    assert answers_of(one)[0]["code"] == "private_address" and receiver.heard == []


def test_the_name_is_resolved_once_and_that_address_is_used(make, robot, receiver, monkeypatch, settings):
    settings.FLEET_WEBHOOK_ALLOW = WebhookAllow(hosts=frozenset({"ci.lab.example"}))
    webhook = make(f"http://ci.lab.example:{receiver.server_port}/")
    [one] = news(webhook, robot)
    asked = []

    def once(host, port, **_options):
        asked.append(host)
        address = "127.0.0.1" if len(asked) == 1 else "192.0.2.1"
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, port))]

    monkeypatch.setattr(socket, "getaddrinfo", once)
    send_due(webhook.pk)
    assert asked == ["ci.lab.example"]
    assert answers_of(one)[0]["status"] == 200
    assert receiver.heard[0][1]["host"] == f"ci.lab.example:{receiver.server_port}"


def test_the_other_family_is_tried(make, robot, receiver, names, settings):
    settings.FLEET_WEBHOOK_ALLOW = WebhookAllow(hosts=frozenset({"ci.lab.example"}))
    names["ci.lab.example"] = ["::1", "127.0.0.1"]  # nobody listens on the first
    webhook = make(f"http://ci.lab.example:{receiver.server_port}/")
    [one] = news(webhook, robot)
    send_due(webhook.pk)
    assert answers_of(one)[0]["status"] == 200


@pytest.fixture
def certificate(tmp_path):
    """A self-signed certificate of ci.lab.example."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "ci.lab.example")])
    now = dt.datetime.now(dt.UTC)
    names = [x509.DNSName("ci.lab.example"), x509.IPAddress(ip_address("192.0.2.1"))]
    builder = x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
    builder = builder.not_valid_before(now - dt.timedelta(days=1)).not_valid_after(now + dt.timedelta(days=1))
    signed = builder.add_extension(x509.SubjectAlternativeName(names), critical=False).sign(
        key, hashes.SHA256()
    )
    file = tmp_path / "cert.pem"
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    file.write_bytes(private + signed.public_bytes(serialization.Encoding.PEM))
    return file


@pytest.mark.parametrize("trusted", [True, False])
@pytest.mark.parametrize("host", ["ci.lab.example", "other.lab.example"])
def test_tls_checks_the_name_and_the_authority(
    host, trusted, make, robot, receiver, names, settings, certificate, monkeypatch
):
    settings.FLEET_WEBHOOK_ALLOW = WebhookAllow(hosts=frozenset({host}))
    names[host] = ["127.0.0.1"]
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate)
    receiver.socket = context.wrap_socket(receiver.socket, server_side=True, do_handshake_on_connect=False)
    receiver.handle_error = lambda *_args: None
    if trusted:
        monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    webhook = make(f"https://{host}:{receiver.server_port}/")
    [one] = news(webhook, robot)
    send_due(webhook.pk)
    [answer] = answers_of(one)
    if trusted and host == "ci.lab.example":
        assert answer["status"] == 200
    else:
        assert answer["code"] == "tls" and receiver.heard == []


# --- claims, ends ---------------------------------------------------------------------------------


def test_a_claimed_delivery_is_left_alone_until_the_claim_lapses(make, robot, receiver):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    claimed = delivery._claim_next(webhook.pk, timezone.now())
    assert claimed == one and send_due(webhook.pk) == 0  # as if its process was killed now
    assert delivery._claim_next(webhook.pk, timezone.now() + delivery.CLAIMED) == one


def test_a_late_answer_of_a_lapsed_claim_changes_nothing(make, robot, receiver):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    late = delivery._claim_next(webhook.pk, timezone.now())
    make_due(one)
    send_due(webhook.pk)
    delivery._note(late, {"good": False, "text": ""}, timezone.now())
    assert len(answers_of(one)) == 1 and one.state == State.DELIVERED


def test_a_clock_that_was_set_back_delays_nothing(make, robot, receiver):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    WebhookDelivery.objects.filter(pk=one.pk).update(due_at=timezone.now() + dt.timedelta(days=400))
    assert send_due(webhook.pk) == 1


def test_news_waits_while_its_owner_is_not_staff(make, robot, receiver, staff, django_user_model):
    webhook = make(receiver.address)
    news(webhook, robot)
    staff.is_staff = False
    staff.save()
    assert send_due(webhook.pk) == 0
    other = django_user_model.objects.create_user("other", is_staff=True)
    services.webhook_resume(webhook=webhook, actor=other)
    assert send_due(webhook.pk) == 1


def test_another_key_of_the_console_is_named(make, robot, receiver, settings):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    settings.SECRET_KEY = "another key, which is long enough to be one"
    send_due(webhook.pk)
    assert answers_of(one)[0]["code"] == "no_secret" and receiver.heard == []


def test_an_event_whose_record_expired_is_given_up_at_once(make, robot, receiver):
    webhook = make(receiver.address)
    [one] = news(webhook, robot)
    WebhookDelivery.objects.filter(pk=one.pk).update(record=10**9)
    send_due(webhook.pk)
    assert len(answers_of(one)) == 1 and one.state == State.GIVEN_UP and receiver.heard == []


def test_old_deliveries_are_removed(make, robot, monkeypatch):
    webhook = make("https://93.184.216.34/")
    old, _new = news(webhook, robot, 2)
    WebhookDelivery.objects.filter(pk=old.pk).update(made_at=timezone.now() - dt.timedelta(days=31))
    assert remove_old_deliveries(timezone.now()) is False
    assert webhook.deliveries.count() == 1
    monkeypatch.setattr(delivery, "REMOVED_BATCH_SIZE", 1)
    assert remove_old_deliveries(timezone.now() + dt.timedelta(days=31)) is True


# --- threads and processes ------------------------------------------------------------------------


@pytest.mark.django_db(transaction=True)
def test_a_receiver_that_hangs_delays_nobody(make, robot, receiver):
    with socket.create_server(("127.0.0.1", 0)) as silent:  # accepts, never answers
        hanging = [make(f"http://127.0.0.1:{silent.getsockname()[1]}/", f"hangs {n}") for n in range(3)]
        webhook, worker = make(receiver.address), WebhookWorker()
        record("control.take", robot_id=robot.id)
        begun = time.monotonic()

        def heard():
            step_s = time.monotonic()
            worker.step()
            assert time.monotonic() - step_s < 1
            return receiver.heard

        until(heard, "the event at the receiver that answers")
        record("control.end", robot_id=robot.id)
        until(lambda: heard()[1:], "the next event, while the others still hang")
        assert time.monotonic() - begun < post.STEP_S
        until(
            lambda: all(answers_of(one.deliveries.earliest("pk")) for one in hanging), "the time limits", 15
        )
        worker._sending.shutdown()
        worker._reading.shutdown()
    assert {one.deliveries.earliest("pk").answers[0]["code"] for one in hanging} == {"timeout"}
    assert webhook.deliveries.filter(state=State.DELIVERED).count() == 2


def housekeeping():
    environment = {
        **outside(),
        "FLEET_VAR": os.environ["FLEET_VAR"],
        "FLEET_SECRET_KEY": os.environ["FLEET_SECRET_KEY"],
        "FLEET_HOSTS": "localhost",
        "FLEET_DATABASE_URL": f"sqlite:///{connection.settings_dict['NAME']}",
        "FLEET_WEBHOOK_ALLOW": "127.0.0.0/8",
    }
    command = [sys.executable, "manage.py", "run_housekeeping"]
    return subprocess.Popen(
        command, env=environment, cwd=REPOSITORY, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL
    )


@pytest.mark.django_db(transaction=True)
@pytest.mark.skipif("connection.vendor != 'sqlite'", reason="one database is enough")
def test_a_killed_process_loses_nothing_and_two_send_once(make, robot, receiver):
    webhook, free = make(receiver.address), threading.Event()
    receiver.acts = lambda _handler: free.wait(30)
    record("control.take", robot_id=robot.id)
    first = housekeeping()
    until(lambda: receiver.heard, "the first attempt")
    record("control.end", robot_id=robot.id)
    os.kill(first.pid, signal.SIGKILL)
    first.wait(10)
    first.stdin.close()
    receiver.acts = None
    free.set()
    for _ in range(8):
        record("control.take", robot_id=robot.id)
    WebhookDelivery.objects.update(due_at=timezone.now())  # as if the claim had lapsed
    both = [housekeeping(), housekeeping()]
    try:
        done = webhook.deliveries.filter(state=State.DELIVERED)
        until(lambda: done.count() == 10, "all deliveries")
        time.sleep(1.5)
    finally:
        for process in both:
            process.terminate()
            process.wait(10)
            process.stdin.close()
    sent = [headers["webhook-id"] for _, headers, _ in receiver.heard]
    assert len(set(sent)) == 10 and len(sent) == 11  # one event twice, with the same identifier
