"""Log messages for the administrator: one line for what a client can cause, tracebacks for faults."""

from __future__ import annotations

import io
import json
import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from django.test import Client
from django.urls import reverse

from fleet.accounts.models import User
from fleet.base.logs import Json, for_journal
from fleet.help import views

pytestmark = pytest.mark.django_db


@pytest.fixture
def log() -> Iterator[io.StringIO]:
    """Lines that the console writes to standard error, through the handler and the filters of its settings."""
    handler = next(one for one in logging.getLogger("django").handlers if type(one) is logging.StreamHandler)
    heard = io.StringIO()
    before = handler.setStream(heard)
    yield heard
    handler.setStream(before)


def test_an_unknown_host_is_one_line_that_names_our_setting(log: io.StringIO) -> None:
    assert Client().get("/", headers={"host": "fleet.example"}).status_code == 400
    said = "Invalid HTTP_HOST header: 'fleet.example'. You may need to add 'fleet.example' to FLEET_HOSTS. [request "
    assert said in log.getvalue()
    assert log.getvalue().count("\n") == 1


def forbidden_page(browser: Client) -> int:
    return browser.get(reverse("booking-policy-all")).status_code


def missing_page(browser: Client) -> int:
    return browser.get("/no%0ATraceback (most recent call last)/").status_code


def forged_form(browser: Client) -> int:
    browser.handler.enforce_csrf_checks = True
    return browser.post(reverse("booking-new"), {}).status_code


def form_of_many_fields(browser: Client) -> int:
    content = "&".join(["f=1"] * 10_001)
    return browser.post(reverse("booking-new"), content, "application/x-www-form-urlencoded").status_code


def broken_form(browser: Client) -> int:
    return browser.post(
        reverse("booking-new"), b"no parts", "multipart/form-data; boundary=" + "b" * 300
    ).status_code


def api_refusal(browser: Client) -> int:
    return browser.get("/api/v1/robots/none").status_code


def api_broken_body(browser: Client) -> int:
    return browser.post("/api/v1/bookings", b"{", "application/json").status_code


@pytest.mark.parametrize(
    ("asks", "status"),
    [
        (forbidden_page, 403),
        (missing_page, 404),
        (forged_form, 403),
        (form_of_many_fields, 400),
        (broken_form, 400),
        (api_refusal, 404),
        (api_broken_body, 400),
    ],
)
def test_a_refused_request_is_one_line(
    log: io.StringIO,
    signed_in: Callable[[User], Client],
    operator: User,
    asks: Callable[[Client], int],
    status: int,
) -> None:
    assert asks(signed_in(operator)) == status
    assert log.getvalue().count("\n") == 1, log.getvalue()


def test_a_fault_keeps_its_traceback(
    log: io.StringIO,
    signed_in: Callable[[User], Client],
    operator: User,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    browser = signed_in(operator)
    browser.raise_request_exception = False

    def fail(*_arguments: object) -> None:
        raise RuntimeError("a fault")

    monkeypatch.setattr(views, "render", fail)
    assert browser.get("/help/").status_code == 500
    assert "Traceback" in log.getvalue()


@pytest.mark.parametrize("form", [{"content_type": "application/x-www-form-urlencoded"}, {}])
def test_a_strangers_form_has_few_fields(client: Client, form: dict[str, str]) -> None:
    fields = {f"f{number}": "1" for number in range(102)}
    sent = "&".join(f"{name}=1" for name in fields) if form else fields
    answer = client.post(reverse("account_login"), sent, **form)
    assert (answer.status_code, "more than 100 fields" in answer.content.decode()) == (400, True)
    scripts = client.post(reverse("account_login"), sent, **form, headers={"accept": "application/json"})
    assert scripts.json()["code"] == "too_many_fields"


def test_lines_for_the_journal_have_their_priority(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with (tmp_path / "journal").open("w") as stream:
        facts = os.fstat(stream.fileno())
        monkeypatch.setenv("JOURNAL_STREAM", f"{facts.st_dev}:{facts.st_ino}")
        assert for_journal("one\ntwo", logging.ERROR, stream) == "<3>one\n<3>two"
        assert for_journal("said", logging.INFO, stream) == "<6>said"
    with (tmp_path / "file").open("w") as elsewhere:
        assert for_journal("said", logging.INFO, elsewhere) == "said"


def test_a_line_of_json_is_one_line_without_secrets() -> None:
    said = logging.LogRecord("fleet", logging.ERROR, "", 1, "ñ\u2028 %s", ("token=abcdefghij",), None)
    said.request_id = "r1"
    (line,) = Json().format(said).splitlines()
    read = json.loads(line)
    assert (read["text"], read["request"], read["level"]) == ("ñ\u2028 token=abcd…", "r1", "ERROR")
