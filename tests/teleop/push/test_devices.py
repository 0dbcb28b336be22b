"""People add and remove devices; nobody makes the console send requests into the lab's network."""

from __future__ import annotations

import pytest

from fleet.accounts.services import account_erase
from fleet.audit.command_line import here
from fleet.audit.models import Record
from fleet.base.environment import WebhookAllow
from teleop.models import PushSubscription
from teleop.push import services
from teleop.push.keys import from_b64, public_key
from tests.teleop.push.conftest import Browser

pytestmark = pytest.mark.django_db

ADD = "/bookings/devices/add/"


def add(client, browser, **more):
    return client.post(ADD, browser.subscription | more, content_type="application/json")


def test_a_person_adds_and_removes_a_device(browser, browsers, operator):
    page = browsers["operator"]
    for _ in range(2):  # the second time the browser only renews it
        assert add(page, browser).status_code == 201
    shown = page.get("/bookings/devices/")
    assert f'data-key="{public_key()}"' in shown.content.decode()
    assert len(from_b64(public_key())) == 65
    [device] = PushSubscription.objects.all()
    assert device.person == operator
    assert device.endpoint not in str(list(Record.objects.values())) + shown.content.decode()
    assert browsers["observer"].post("/bookings/devices/", {"remove": device.pk}).status_code == 404
    assert page.post("/bookings/devices/", {"remove": device.pk}).status_code == 302
    assert not PushSubscription.objects.exists()
    kinds = Record.objects.filter(kind__startswith="push.").order_by("pk").values_list("kind", flat=True)
    assert list(kinds) == ["push.add", "push.remove"]


@pytest.mark.parametrize(
    "endpoint",
    [
        "http://push.example.org/1",
        "https://10.0.0.1/1",
        "https://127.0.0.1/1",
        "https://[::1]/1",
        "https://169.254.169.254/latest/meta-data",
        "https://[::ffff:192.168.1.1]/1",
        "https://user@push.example.org/1",
        "ftp://push.example.org/1",
        "https://push.example.org/" + 500 * "x",
    ],
)
def test_a_push_service_in_the_own_network_is_refused(browsers, settings, endpoint):
    settings.FLEET_WEBHOOK_ALLOW = WebhookAllow(hosts=frozenset({"10.0.0.1"}))  # for staff only
    answer = add(browsers["operator"], Browser(endpoint))
    assert (answer.status_code, answer.json()["code"]) == (400, "bad_push_service")
    assert not PushSubscription.objects.exists()


@pytest.mark.parametrize(
    "sent",
    [
        {"keys": {}},
        {"keys": None},
        {"keys": {"p256dh": "AAAA", "auth": "AAAA"}},
        {"keys": {"p256dh": "é", "auth": "é"}},
        {"endpoint": 7},
        {"more": 5000 * "x"},
    ],
)
def test_what_is_no_subscription_is_refused(browser, browsers, sent):
    answer = add(browsers["operator"], browser, **sent)
    assert answer.status_code == 400
    assert answer.json()["detail"]


def test_a_person_has_few_devices(service, browsers):
    page = browsers["operator"]
    answers = [add(page, Browser(f"http://127.0.0.1/{number}")) for number in range(services.MOST + 1)]
    assert [answer.status_code for answer in answers] == [201] * services.MOST + [400]
    assert answers[-1].json()["code"] == "too_many_devices"


def test_a_browser_belongs_to_who_used_it_last(browser, browsers, operator, observer):
    add(browsers["operator"], browser)
    add(browsers["observer"], browser)
    assert PushSubscription.objects.get().person == observer
    browsers["observer"].post("/accounts/sign-out/")
    assert not PushSubscription.objects.exists()


def test_an_erased_persons_devices_are_gone(browser, browsers, operator):
    add(browsers["operator"], browser)
    account_erase(user=operator, actor=here())
    assert not PushSubscription.objects.exists()


def test_a_key_that_cannot_be_read_is_made_again(browser, browsers, settings):
    before = public_key()
    assert public_key() == before
    add(browsers["operator"], browser)
    settings.SECRET_KEY = "another key of the console, long enough"
    assert public_key() != before
    assert not PushSubscription.objects.exists()  # they know the old key


def test_a_device_needs_a_signed_in_person(client, browser):
    assert add(client, browser).status_code in (302, 401, 403)
