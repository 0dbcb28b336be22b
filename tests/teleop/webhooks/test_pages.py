"""The pages of webhooks: for staff; the secret is shown once."""

import re

import pytest
from django.urls import reverse

from teleop.models import Webhook, WebhookDelivery
from teleop.webhooks.delivery import send_due

pytestmark = pytest.mark.django_db

FORM = {"name": "CI", "address": "https://ci.example.org/fleet", "kinds": ["stops", "speech"]}


@pytest.mark.parametrize("who", ["operator", "supervisor", "staff"])
def test_the_pages_are_for_staff(who, request, make, signed_in):
    webhook = make("https://93.184.216.34/")
    client = signed_in(request.getfixturevalue(who))
    pages = [reverse("webhooks"), reverse("webhook-new"), reverse("webhook", args=[webhook.pk])]
    expected = 200 if who == "staff" else 403
    assert [client.get(page).status_code for page in pages] == [expected] * 3
    if who != "staff":
        for action in ("test", "pause", "delete"):
            assert client.post(pages[2], {"action": action}).status_code == 403
        assert client.post(pages[1], FORM).status_code == 403
        assert Webhook.objects.get().paused_at is None
        assert "/webhooks/" not in client.get("/").text


def test_a_new_webhook_shows_its_secret_once(staff, robot, signed_in):
    client = signed_in(staff)
    page = client.post("/webhooks/new/", {**FORM, "robots": [robot.pk]}).text
    secret = re.search(r"whsec_[A-Za-z0-9+/=]+", page)[0]
    webhook = Webhook.objects.get()
    assert (webhook.kinds, list(webhook.robots.all()), webhook.texts) == (["speech", "stops"], [robot], False)
    for address in ("/webhooks/", f"/webhooks/{webhook.pk}/"):
        page = client.get(address).text
        assert "CI" in page and secret not in page and webhook.secret not in page


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"address": "https://10.0.0.1/"}, "FLEET_WEBHOOK_ALLOW does not have it"),
        ({"address": "http://ci.example.org/"}, "Use https"),
        ({"name": ""}, "required"),
        ({"kinds": []}, "required"),
        ({"kinds": ["gossip"]}, "gossip"),
        ({"robots": ["x"]}, "not a valid"),
    ],
)
def test_what_is_wrong_is_said(change, said, staff, signed_in):
    page = signed_in(staff).post("/webhooks/new/", {**FORM, **change})
    assert page.status_code == 400 and said in page.text
    assert not Webhook.objects.exists()


def test_a_name_is_there_once(staff, signed_in):
    client = signed_in(staff)
    client.post("/webhooks/new/", FORM)
    assert "Another webhook has this name" in client.post("/webhooks/new/", FORM).text


def test_test_pause_resume_delete(make, receiver, staff, signed_in):
    webhook, client = make(receiver.address), signed_in(staff)
    page = f"/webhooks/{webhook.pk}/"
    assert "on its way" in client.post(page, {"action": "test"}, follow=True).text
    send_due(webhook.pk)
    [(_path, headers, body)] = receiver.heard
    assert headers["webhook-id"].startswith("test_") and b'"type":"webhook.test"' in body
    shown = client.get(page).text
    assert "delivered" in shown and "200" in shown and "heard" in shown
    client.post(page, {"action": "pause"})
    assert "paused" in client.get("/webhooks/").text
    assert "Resume it first" in client.post(page, {"action": "test"}, follow=True).text
    client.post(page, {"action": "resume"})
    assert Webhook.objects.get().paused_at is None
    assert client.post(page, {"action": "burn"}).status_code == 400
    assert client.post(page, {"action": "delete"}).url == "/webhooks/"
    assert not Webhook.objects.exists() and not WebhookDelivery.objects.exists()
    assert client.get(page).status_code == 404


def test_answers_are_shown_as_text(make, staff, signed_in):
    webhook = make("https://93.184.216.34/")
    answer = {
        "at": "2026-03-02T09:00:00.000Z",
        "status": 500,
        "took_s": 0.1,
        "text": "<script>alert(1)</script>",
    }
    now = webhook.made_at
    WebhookDelivery.objects.create(
        webhook=webhook, kind="stop.press", made_at=now, due_at=now, answers=[answer]
    )
    assert "&lt;script&gt;alert(1)" in signed_in(staff).get(f"/webhooks/{webhook.pk}/").text
