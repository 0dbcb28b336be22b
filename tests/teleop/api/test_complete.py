"""Programs can do all that pages can do: each message and form has an operation, which the docs list."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args
from uuid import UUID

import pytest
from django.test import Client
from django.urls import URLPattern, get_resolver

from fleet.accounts.models import User
from robots.shared import wire
from script.generate import messages

DOCS = Path(__file__).parents[3] / "docs" / "api.md"
ROBOT = "/robots/{slug}"
_TASKS = [kind for kind in wire.TASK_KINDS if kind.address]
OPERATIONS: dict[type, tuple[str, str]] = {
    **{kind.request: ("post", f"{ROBOT}/{kind.address}") for kind in _TASKS},
    **{kind.cancel: ("delete", f"{ROBOT}/{kind.address}") for kind in _TASKS if kind.cancel},
    wire.Take: ("post", f"{ROBOT}/control"),
    wire.TakeOver: ("post", f"{ROBOT}/control"),
    wire.Release: ("delete", f"{ROBOT}/control"),
    wire.Renew: ("post", f"{ROBOT}/control/renew"),
    wire.Ask: ("post", f"{ROBOT}/control/line"),
    wire.AskCancel: ("delete", f"{ROBOT}/control/line"),
    wire.HandOver: ("post", f"{ROBOT}/control/hand-over"),
    wire.Drive: ("post", f"{ROBOT}/velocity"),
    wire.SetPose: ("put", f"{ROBOT}/pose"),
    wire.MoveLimb: ("post", f"{ROBOT}/gripper"),
    wire.LimbCancel: ("delete", f"{ROBOT}/gripper"),
    wire.Play: ("post", f"{ROBOT}/motions/{{name}}"),
    wire.PlayCancel: ("delete", f"{ROBOT}/motion"),
    wire.Choose: ("put", f"{ROBOT}/inputs/{{use}}"),
    wire.Stop: ("post", f"{ROBOT}/stop"),
    wire.Clear: ("post", f"{ROBOT}/stop/clear"),
    wire.Record: ("post", f"{ROBOT}/recordings"),
    wire.RecordEnd: ("delete", f"{ROBOT}/recordings/{{recording_id}}"),
    wire.KeepThis: ("post", f"{ROBOT}/keep-this"),
    wire.ListTopics: ("get", f"{ROBOT}/topics"),
    wire.Describe: ("get", f"{ROBOT}/topics/definition"),
    wire.Subscribe: ("get", f"{ROBOT}/topics/message"),
    wire.DescribeService: ("get", f"{ROBOT}/services/definition"),
    wire.CallService: ("post", f"{ROBOT}/services/call"),
    wire.ListParameters: ("get", f"{ROBOT}/parameters"),
    wire.GetParameter: ("get", f"{ROBOT}/parameters/value"),
    wire.SetParameter: ("put", f"{ROBOT}/parameters/value"),
    wire.StopAll: ("post", "/stop"),
    wire.StopRobot: ("post", f"{ROBOT}/stop"),
    wire.ClearRobot: ("post", f"{ROBOT}/stop/clear"),
}
# For each form of a page, by the name of its address: an operation for each action.
BOOKING, COURSE, POLICY = "/bookings/{booking_id}", "/courses/{slug}", "/policies"
FORMS: dict[str, tuple[tuple[str, str], ...]] = {
    "stop": (("post", f"{ROBOT}/stop"),),
    "stop-all": (("post", "/stop"),),
    "your-data-export": (("post", "/audit/export"),),
    "webhook-new": (("post", "/webhooks"),),
    "webhook": (
        ("patch", "/webhooks/{webhook_id}"),
        ("delete", "/webhooks/{webhook_id}"),
        ("post", "/webhooks/{webhook_id}/test"),
        ("post", "/webhooks/{webhook_id}/again"),
    ),
    "booking-new": (("post", "/bookings"),),
    "booking": (
        ("patch", BOOKING),
        ("delete", BOOKING),
        ("post", f"{BOOKING}/hand-over"),
        ("post", f"{BOOKING}/approve"),
        ("post", f"{BOOKING}/accept"),
    ),
    "lesson": (
        ("post", f"{BOOKING}/lesson/line"),
        ("delete", f"{BOOKING}/lesson/line"),
        ("post", f"{BOOKING}/lesson/call"),
        ("post", f"{BOOKING}/lesson/everybody"),
        ("post", f"{BOOKING}/lesson/spread"),
        ("put", f"{BOOKING}/lesson/tasks"),
        ("post", f"{BOOKING}/lesson/hold"),
        ("delete", f"{BOOKING}/lesson/hold"),
        ("post", f"{BOOKING}/lesson/turns/{{turn_id}}"),
        ("delete", f"{BOOKING}/lesson/turns/{{turn_id}}"),
    ),
    "hand-answer": (("post", "/hand-offers/{offer_id}/accept"), ("delete", "/hand-offers/{offer_id}")),
    "hand-make-link": (("post", f"{BOOKING}/hand-over"),),
    "bookings-waiting": (("post", "/waiting"), ("delete", "/waiting/{number}")),
    "booking-policy-all": (("put", f"{POLICY}/all"),),
    "booking-policy-group": (("put", f"{POLICY}/groups/{{slug}}"), ("delete", f"{POLICY}/groups/{{slug}}")),
    "booking-policy": (("put", f"{POLICY}/robots/{{slug}}"), ("delete", f"{POLICY}/robots/{{slug}}")),
    "booking-series": (("post", "/bookings/series"),),
    "booking-whole-series": (("patch", "/bookings/series/{series}"), ("delete", "/bookings/series/{series}")),
    "change-undo": (("post", "/changes/{change_id}/undo"),),
    "holidays": (("post", "/holidays"),),
    "holiday-remove": (("delete", "/holidays/{holiday_id}"),),
    "out-of-service": (("post", "/out-of-service"),),
    "out-of-service-end": (("delete", "/out-of-service/{period_id}"),),
    "token-new": (("post", "/tokens"),),
    "token-end": (("delete", "/tokens/{token_id}"),),
    "service-accounts": (("post", "/service-accounts"),),
    "service-token-new": (("post", "/service-accounts/{username}/tokens"),),
    "robot-groups": (
        ("post", "/robot-groups"),
        ("put", "/robot-groups/{slug}"),
        ("delete", "/robot-groups/{slug}"),
        ("put", "/robot-groups/{slug}/roles/{username}"),
        ("delete", "/robot-groups/{slug}/roles/{username}"),
    ),
    "qualifications": (
        ("post", "/qualifications"),
        ("put", "/qualifications/{slug}"),
        ("delete", "/qualifications/{slug}"),
    ),
    "course-new": (("post", "/courses"), ("post", f"{COURSE}/members")),
    "course-edit": (("patch", COURSE),),
    "course-archive": (("patch", COURSE),),
    "course-enrol": (("post", f"{COURSE}/members"),),
    "course-people": (
        ("delete", f"{COURSE}/members/{{username}}"),
        ("post", f"{COURSE}/welcome"),
        ("post", f"{COURSE}/qualifications/{{qualification}}/grant"),
        ("post", f"{COURSE}/qualifications/{{qualification}}/revoke"),
    ),
    "invitation-new": (("post", f"{COURSE}/invitations"),),
    "invitation-revoke": (("delete", f"{COURSE}/invitations/{{invitation_id}}"),),
}
SIGN_IN = "a person signs in, and proves who they are"
ACCOUNT = "the account of a person: a program that has a token must not be able to take it over"
BROWSER = "about this person’s browser"
FOR_PEOPLE: dict[str, str] = {
    "sign-in": SIGN_IN,
    "account_login": SIGN_IN,
    "account_reauthenticate": SIGN_IN,
    "openid_connect_login": SIGN_IN,
    "openid_connect_callback": SIGN_IN,
    "sign-out": BROWSER,
    "account_logout": BROWSER,
    "session-end": BROWSER,
    "sessions-end-others": BROWSER,
    "your-settings": BROWSER,
    "page-choices": "the arrangement of a person's pages",
    "bookings-news-seen": BROWSER,
    "push-devices": BROWSER,
    "push-device-add": BROWSER,
    "password": ACCOUNT,
    "account_email": ACCOUNT,
    "account_confirm_email": ACCOUNT,
    "account_reset_password": ACCOUNT,
    "account_reset_password_from_key_done": ACCOUNT,
    "account_reset_password_from_key": ACCOUNT,
    "socialaccount_connections": ACCOUNT,
    "bookings-address": "a private address that opens a person’s calendar without sign-in",
    "join": "a person agrees to join a course",
    "welcome": "a newcomer chooses a password",
    "course-links": ACCOUNT,
    "person-link": ACCOUNT,
    "mail": "a person looks into a mailbox",
    "bridge-host-join": "a new computer shows its one-time code",
    "alert-rules": "set once, with the mail server",
    "people-export": "data of other people: a person looks whose",
    "people-erase": "nobody can undo it: a person looks whom",
    "sign-in-rules": "set once, beside the settings of the organisation's provider",
    "setup": "before there is an account",
    "setup-robot": "the first steps in a browser; `POST /registry` does the same",
}
SECOND_FACTOR = "mfa_"  # prefix of the names of its pages, which are for people, too
OTHER_DOORS = ("api/", "admin/")  # the API itself; the admin, whose accounts and log are for people
OF_THE_CONNECTION = {
    *(wire.Hello, wire.Ack, wire.Ping, wire.Refresh, wire.Unsubscribe, wire.CameraView, wire.ShowJoints)
}
MESSAGES = {*get_args(wire.BrowserMessage), *get_args(wire.TopicsMessage), *get_args(wire.FleetMessage)}


@pytest.fixture(scope="module")
def paths() -> Any:
    return json.loads(messages.OPENAPI.read_text())["paths"]


def test_each_message_of_a_page_has_an_operation(paths: Any) -> None:
    assert set(OPERATIONS) == MESSAGES - OF_THE_CONNECTION
    for message, (method, path) in OPERATIONS.items():
        assert method in paths.get(f"/api/v1{path}", {}), message


@pytest.mark.django_db(transaction=True)
def test_each_form_of_a_page_has_an_operation_or_a_reason(paths: Any, staff: User) -> None:
    found, known = forms_of_pages(staff), FORMS.keys() | FOR_PEOPLE.keys()
    assert (found - known, known - found) == (set(), set())
    assert not FORMS.keys() & FOR_PEOPLE.keys()
    for form, operations in FORMS.items():
        for method, path in operations:
            assert method in paths.get(f"/api/v1{path}", {}), (form, path)


def forms_of_pages(staff: User) -> set[str]:
    """Return the names of pages that accept a POST; for a page without a name, its address."""
    found = set()
    addresses = list(_addresses(get_resolver()))
    named = {pattern.callback for pattern, _ in addresses if pattern.name}
    for pattern, address in addresses:
        name = pattern.name or ("" if pattern.callback in named else address)
        if not name or name.startswith(SECOND_FACTOR) or address.startswith(OTHER_DOORS):
            continue
        client = Client(raise_request_exception=False)
        client.force_login(staff)
        if client.post(f"/{address}").status_code != 405:
            found.add(name)
    return found


def _addresses(resolver: Any, before: str = "") -> Iterator[tuple[URLPattern, str]]:
    """Yield each pattern with an address that fits it."""
    for one in resolver.url_patterns:
        address = before + _filled(one.pattern)
        if isinstance(one, URLPattern):
            yield one, address
        else:
            yield from _addresses(one, address)


def _filled(pattern: Any) -> str:
    if hasattr(pattern, "_route"):
        return re.sub(
            "<(?:([a-z]+):)?[a-z_0-9]+>",
            lambda found: str(UUID(int=1)) if found[1] == "uuid" else "1",
            pattern._route,
        )
    return re.sub(r"\(\?P<.*?>.*?\)", "1", pattern.regex.pattern.strip("^$"))


def test_each_operation_of_a_robot_stands_in_the_docs(paths: Any) -> None:
    text = DOCS.read_text().replace("…/", f"{ROBOT}/") + messages.page()  # which lists the kinds of tasks
    named = set(re.findall(r"/[a-z][a-z{}/_-]*[a-z}]", text))
    missing = {path.removeprefix("/api/v1") for path in paths} - {*named, "/"}
    assert not missing
