"""Headers and access of every page, and the page for monitoring."""

import pytest
from django.conf import settings
from django.db import DatabaseError, connection
from django.test import Client

from tests.conftest import PASSWORD

pytestmark = pytest.mark.django_db

BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"

POLICY = {
    "default-src 'none'",
    "script-src 'self'",
    "style-src 'self'",
    "img-src 'self'",
    "manifest-src 'self'",
    "connect-src 'self'",
    "form-action 'self'",
    "base-uri 'none'",
    "frame-ancestors 'none'",
}


@pytest.mark.parametrize(
    "page", ["/accounts/sign-in/", "/healthz", "/nowhere/", "/admin/", "/accounts/sessions/"]
)
@pytest.mark.parametrize("who", ["anonymous", "staff"])
def test_every_page_carries_the_strict_policy(page, who, staff, signed_in):
    client = Client() if who == "anonymous" else signed_in(staff)
    headers = client.get(page).headers
    assert set(headers["Content-Security-Policy"].split("; ")) == POLICY
    assert headers["X-Frame-Options"] == "DENY"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "same-origin"
    assert "camera=()" in headers["Permissions-Policy"]


@pytest.mark.parametrize("page", ["/accounts/sessions/", "/admin/", "/admin/accounts/user/"])
def test_a_page_makes_people_sign_in_and_brings_them_back(page):
    response = Client().get(page, follow=True, headers={"accept": BROWSER})
    assert response.redirect_chain[-1] == (f"/accounts/sign-in/?next={page}", 302)


def test_only_the_two_named_cookies_are_kept(staff, robot):
    client = Client()
    sign_in = {"username": "staff", "password": PASSWORD}
    shown = client.post("/accounts/sign-in/", {**sign_in, "password": "wrong"}).text
    shown += client.post("/accounts/sign-in/", sign_in, follow=True).text
    for page in (
        "/",
        f"/robots/{robot.slug}/",
        "/cookies/",
        "/your-data/",
        "/nowhere/",
        "/admin/audit/record/",
    ):
        shown += client.get(page).text
    words = {"old_password": PASSWORD, "new_password1": "another walk", "new_password2": "another walk"}
    role = {"user": staff.pk, "robot": robot.pk, "role": "observer"}
    for page, form in (
        ("/accounts/password/", words),
        ("/accounts/sessions/end-others/", {}),
        ("/admin/robots/robotrole/add/", role),
        (f"/robots/{robot.slug}/stop/", {}),
    ):
        shown += client.post(page, form, follow=True, headers={"accept": BROWSER}).text
    for sentence in ("Your password is changed", "There was no other session", "was added", "Pending, not"):
        assert sentence in shown
    assert set(client.cookies) == {settings.SESSION_COOKIE_NAME, settings.CSRF_COOKIE_NAME}


# "*/*": curl and requests; None: no Accept header
@pytest.mark.parametrize("accept", ["application/json", "*/*", None])
@pytest.mark.parametrize("page", ["/stop-all/", "/your-data/export/"])
def test_a_script_learns_that_it_is_not_signed_in(page, accept):
    response = Client().post(page, headers={"accept": accept} if accept else {})
    assert (response.status_code, response.json()["code"]) == (401, "signed_out")


def test_the_admin_is_for_staff(operator, signed_in):
    assert signed_in(operator).get("/admin/", follow=True).status_code == 403


def test_moments_in_the_admin_say_in_which_zone_they_are(staff, signed_in):
    page = signed_in(staff).get(f"/admin/accounts/user/{staff.pk}/change/").text
    assert f"{staff.date_joined:%H:%M} UTC" in page


def test_the_admin_has_no_separate_sign_in_page(staff, signed_in):
    assert signed_in(staff).get("/admin/login/", follow=True).redirect_chain == [("/admin/", 302)]


def test_health_is_public_and_good():
    response = Client().get("/healthz")
    ready = {"ok": True, "text": "Ready.", "needs": {}, "looked_s": None}
    assert (response.status_code, response.json()) == (200, ready)


def test_health_says_that_the_database_is_away(monkeypatch):
    def away():
        raise DatabaseError("connection refused")

    monkeypatch.setattr(connection, "cursor", away)
    with pytest.raises(DatabaseError):
        connection.cursor()
    response = Client().get("/healthz")
    assert (response.status_code, response.json()["text"]) == (503, "The database does not answer.")


def test_a_foreign_host_name_is_refused_in_words():
    answer = Client().get("/", headers={"host": "elsewhere.example"})
    assert answer.status_code == 400
    assert "a name that is not this console’s" in answer.text


@pytest.mark.parametrize(
    ("who", "path", "status", "advice", "way_on"),
    [
        ("operator", "/admin/", 403, "You are signed in as Olga Operator", "/access/"),
        ("operator", "/robots/gone/", 404, "It was deleted or renamed", "/access/"),
        ("operator", "/nowhere/", 404, "Was it typed or copied wrongly?", "/"),
        ("operator", "/webhooks/", 403, "supervisors or staff", "/"),
        ("staff", "/bookings/policies/group/gone/", 404, "It was deleted, or you may not see it", "/"),
        ("anonymous", "/nowhere/", 404, "Was it typed or copied wrongly?", "/accounts/sign-in/"),
    ],
)
def test_refusals_of_pages_advise_in_each_case(who, path, status, advice, way_on, request, signed_in):
    client = Client() if who == "anonymous" else signed_in(request.getfixturevalue(who))
    answer = client.get(path, follow=True)
    assert answer.status_code == status
    assert advice in answer.text
    assert f'href="{way_on}"' in answer.text.partition("<main")[2]


def test_a_form_from_another_sign_in_is_refused_in_words():
    answer = Client(enforce_csrf_checks=True).post("/accounts/sign-in/", {"username": "somebody"})
    assert answer.status_code == 403
    assert "reload the page" in answer.text
