"""The stop by form works even if the rest of the request is malformed."""

import json

import pytest
from django.test import Client

from robots.shared import wire
from teleop.background.database import in_database

pytestmark = pytest.mark.django_db(transaction=True)

ADDRESSES = [
    "/api/v1/stop/",
    "/api/v1/stop",
    "/api/v1/robots/tiago-1/stop/",
    "/api/v1/robots/tiago-1/stop",
    "/robots/tiago-1/stop/",
    "/robots/tiago-1/stop",
    "/stop-all/",
    "/stop-all",
]
BROKEN_MULTIPART = ("--x\r\nContent-Disposition: form-data", "multipart/form-data; boundary=x")
FORMS = {
    "plain": {},
    "accept html": {"headers": {"accept": "text/html"}},
    "accept xml": {"headers": {"accept": "application/xml"}},
    "accept nonsense": {"headers": {"accept": ";;/q=,*"}},
    "format": {"query_params": {"format": "api"}},
    "broken json": {"data": "{", "content_type": "application/json"},
    "json that is no object": {"data": "[1, 2", "content_type": "application/json"},
    "xml": {"data": "<stop/>", "content_type": "application/xml"},
    "no type": {"data": "x", "content_type": ""},
    "type nonsense": {"data": "x", "content_type": "/;;charset=?"},
    "broken multipart": {"data": BROKEN_MULTIPART[0], "content_type": BROKEN_MULTIPART[1]},
    "multipart without boundary": {"data": "x", "content_type": "multipart/form-data"},
    "too many fields": {
        "data": "&".join(f"a{n}=1" for n in range(2000)),
        "content_type": "application/x-www-form-urlencoded",
    },
    "other encoding": {"data": "a=b", "content_type": "application/x-www-form-urlencoded; charset=utf-7"},
    "large": {"data": "x" * 3_000_000, "content_type": "application/x-www-form-urlencoded"},
}


def browser_of(person):
    """Return a browser whose requests get the CSRF check, and its CSRF token."""
    browser = Client(enforce_csrf_checks=True)
    browser.force_login(person)
    browser.get("/accounts/sign-in/")
    browser.get("/")
    token = next(cookie.value for name, cookie in browser.cookies.items() if name.startswith("fleet_csrf"))
    return browser, token


def post(browser, address, *, token, headers=None, **form):
    headers = {**(headers or {}), **({"x-csrftoken": token} if token else {})}
    return browser.post(address, headers=headers, **{"content_type": "application/json", **form})


@pytest.mark.parametrize("form", FORMS)
async def test_stop_is_never_refused_for_its_form(observer, robot, bridge, form):
    browser, token = await in_database(browser_of, observer)
    for number, address in enumerate(ADDRESSES, 1):
        answer = await in_database(lambda address=address: post(browser, address, token=token, **FORMS[form]))
        await bridge.hears(wire.LinkStop, count=number)
        assert answer.status_code == 200, address
        if address.startswith("/api/"):
            assert json.loads(answer.content)["robots"]["tiago-1"]["stop"]["state"] == "stopping"


async def test_form_without_scripts_has_its_token_in_the_body(observer, robot, bridge):
    browser, token = await in_database(browser_of, observer)
    fields = {"csrfmiddlewaretoken": token}
    answer = await in_database(lambda: browser.post("/robots/tiago-1/stop", fields))
    assert answer.status_code == 200
    await bridge.hears(wire.LinkStop)


@pytest.mark.parametrize("form", ["plain", "broken multipart", "other encoding", "large", "accept html"])
@pytest.mark.parametrize("token", [None, "x" * 32])
async def test_another_site_stops_nothing(observer, robot, bridge, form, token):
    browser, _ = await in_database(browser_of, observer)
    for address in ADDRESSES:
        answer = await in_database(lambda address=address: post(browser, address, token=token, **FORMS[form]))
        assert answer.status_code == 403, address
    assert not bridge.all(wire.LinkStop)


async def test_signed_out_request_stops_nothing(robot, bridge):
    for address in ADDRESSES:
        answer = await in_database(lambda address=address: Client().post(address, headers={"accept": "*/*"}))
        assert (answer.status_code, answer.json()["code"]) == (401, "signed_out"), address
    assert not bridge.all(wire.LinkStop)


async def test_get_request_stops_nothing(browsers, robot, bridge):
    for address in ADDRESSES:
        answer = await in_database(lambda address=address: browsers["observer"].get(address))
        assert (answer.status_code, answer.json()["code"]) == (405, "method_not_allowed"), address
    assert not bridge.all(wire.LinkStop)
