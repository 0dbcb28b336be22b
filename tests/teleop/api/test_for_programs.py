"""Programs expect this of any API: a first address, filters and order, ids of requests, rates, pages of errors."""

from __future__ import annotations

import json
import re

import pytest
from asgiref.sync import async_to_sync
from django.test import Client

from script.generate import errors
from teleop.api.v1.framework import rates
from tests.teleop.api.test_bookings import book
from tests.teleop.api.test_codes import built, documented
from tests.teleop.api.test_records import said, session_of

pytestmark = pytest.mark.django_db


def test_the_first_address_lists_those_to_begin_with(robot, operator, program):
    api = program(operator, "read")
    found = api("GET", "/").data
    robots = next(one for one in found["entries"] if one["address"] == "/api/v1/robots")
    assert robots["methods"] == {"GET": "List the robots that you may see"}
    for entry in found["entries"]:
        assert "{" not in entry["address"]
        if "GET" in entry["methods"] and not entry["address"].endswith("/events"):
            assert api("GET", entry["address"].removeprefix("/api/v1")).status_code in (200, 403)
    assert Client().get("/api/v1/").status_code == 401


def test_lists_begin_with_the_oldest_if_a_program_asks(robot, operator, program):
    api = program(operator)
    sessions = [session_of(robot, operator, number, hours_ago=9 - number) for number in (1, 2, 3)]
    numbers = [said(robot, operator, f"text {number}") for number in (1, 2, 3)]
    starts = [str(book(robot, operator, hour).pk) for hour in (1, 3, 5)]
    for path, key, name, wanted in (
        ("/sessions?", "sessions", "id", [str(one.pk) for one in sessions]),
        ("/bookings?", "bookings", "id", starts),
        ("/audit?kind=speech.start&", "records", "number", numbers),
    ):
        for order, expected in (("oldest", wanted), ("newest", wanted[::-1])):
            seen, cursor = [], ""
            while True:
                page = api("GET", f"{path}order={order}&limit=2{cursor}").data
                seen += [one[name] for one in page[key]]
                if page["next"] is None:
                    break
                cursor = f"&cursor={page['next']}"
            assert seen == expected, (path, order)
    assert api("GET", "/bookings?order=name").data["code"] == "invalid"


def test_lists_are_filtered(robot, other_robot, staff, operator, program):
    api = program(staff)
    api("POST", "/robot-groups", {"name": "Twins", "robots": ["tiago-2"]})
    slugs = lambda query: [one["slug"] for one in api("GET", f"/robots{query}").data["robots"]]  # noqa: E731
    assert slugs("?group=twins") == ["tiago-2"]
    assert slugs("?enabled=false") == []
    assert slugs("?profile=none") == []
    assert slugs("") == slugs(f"?profile={robot.profile.slug}&enabled=true")
    kept, cancelled = book(robot, operator, 1), book(robot, operator, 3)
    api("DELETE", f"/bookings/{cancelled.pk}", If_Match='"1"')
    found = api("GET", "/bookings?state=booked").data["bookings"]
    assert [one["id"] for one in found] == [str(kept.pk)]
    assert [one["id"] for one in api("GET", "/bookings?state=cancelled").data["bookings"]] == [
        str(cancelled.pk)
    ]


def test_each_answer_has_the_id_of_its_request(operator, program, caplog):
    api = program(operator, "read")
    own = api("GET", "/robots", X_Request_ID="night-42")
    assert own["X-Request-ID"] == "night-42"
    made = [api("GET", "/robots", X_Request_ID=given)["X-Request-ID"] for given in ("", "a b", "a" * 65)]
    assert len({*made}) == 3
    assert all(re.fullmatch("[0-9a-f]{32}", one) for one in made)
    assert api("GET", "/nothing", X_Request_ID="night-43")["X-Request-ID"] == "night-43"


def test_answers_say_what_is_left_of_the_rate(operator, program, monkeypatch):
    monkeypatch.setattr(rates, "PER_S", 0.001)
    api = program(operator, "read")
    left = [int(re.search(r";r=(\d+);", api("GET", "/robots")["RateLimit"])[1]) for _ in range(3)]
    assert left == [left[0], left[0] - 1, left[0] - 2]
    assert api("GET", "/robots")["RateLimit-Policy"] == rates.POLICY


def test_own_data_and_the_report_by_a_program(robot, staff, operator, supervisor, program):
    said(robot, operator, "Hello")
    book(robot, operator, 1)
    answer = program(operator, "read").stream("POST", "/own-data")
    assert answer.status_code == 200
    content = async_to_sync(_content)(answer)
    lines = [json.loads(line) for line in content.splitlines()]
    assert "speech.start" in [line["kind"] for line in lines]
    bound = program(operator, "read", robots=[robot])
    assert bound("POST", "/own-data").data["code"] == "other_robots"
    report = program(supervisor, "read")("GET", "/bookings/report?by=person&to=2100-01-01").data
    assert [(row["name"], row["bookings"], row["booked_h"]) for row in report["rows"]] == [
        ("Olga Operator", 1, 1.0)
    ]
    assert program(operator, "read")("GET", "/bookings/report").status_code == 403


async def _content(answer):
    return b"".join([piece async for piece in answer.streaming_content])


def test_each_error_code_has_a_page_for_anybody(robot, operator, program):
    refused = program(operator)("POST", "/robots/tiago-1/velocity", {"forward_mps": 0.1})
    assert refused.data["type"] == "/help/errors/no_lease/"
    text = Client().get(refused.data["type"]).content.decode()
    assert "This program does not have control: take it first." in text
    assert "HTTP 409" in text
    for code in {*documented(), *built()}:
        assert Client().get(f"/help/errors/{code}/").status_code == 200, code
    assert Client().get("/help/errors/nothing/").status_code == 404


def test_the_page_of_codes_matches_the_source():
    assert errors.PAGE.read_text() == errors.page(), "run script/messages"
