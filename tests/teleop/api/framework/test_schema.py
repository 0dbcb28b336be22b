"""The committed OpenAPI schema is current, and correct for requests of all kinds."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from copy import deepcopy
from datetime import timedelta
from functools import cache
from itertools import cycle
from typing import Any
from urllib.parse import parse_qsl

import pytest
import schemathesis
from django.core.signals import request_finished, request_started
from django.core.wsgi import get_wsgi_application
from django.db import close_old_connections
from django.utils import timezone
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis.core import NOT_SET
from schemathesis.schemas import BaseSchema
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from robots.registry.models import RobotProfile
from script.generate.messages import OPENAPI, openapi
from teleop.records import refusals
from teleop.stop import emergency_stop
from tests.teleop.api.test_matrix import (
    NO_LEASE,
    NO_PROGRAMS,
    PEOPLE,
    Lab,
    filled,
    operations,
    stopped,
    table,
    undone,
)

CHECKS = (status_code_conformance, content_type_conformance, response_schema_conformance)
EXAMPLES_SHARE = 1 / 40  # of those of other property tests, for each operation and person
PARTS = ("path_parameters", "query", "headers", "cookies", "body", "media_type", "multipart_content_types")
Parts = dict[str, Any]
WHO = ("staff", "supervisor", "teacher", "operator", "observer", "stranger", "nobody")
# Not done here: there is no robot, the stream does not end, and nobody can wait for a free slot.
AWAY = {
    "waiting_join",
    "events",
    "map_read",  # needs a bridge
    "cameras_picture",
    "lesson_tasks",  # the booking of the table is of a team
    "map_picture",
    "description_read",
    "mesh_read",
    *("recording_begin", "recording_end", "recording_keep_this"),
    *(f"recordings_{name}" for name in ("file", "picture", "read", "series", "thumbnail", "views")),
}


def test_the_committed_schema_is_the_present_one() -> None:
    assert OPENAPI.read_text() == openapi(), "run script/messages"


def tokens(person: User) -> list[dict[str, str]]:
    """Return the headers of tokens: a token with all scopes before each token with a single scope."""
    expires, headers = timezone.now() + timedelta(days=1), []
    for scopes in [list(Scope), *([scope] for scope in Scope)]:
        _, text = token_make(user=person, name="fuzz", scopes=scopes, expires_at=expires, actor=person)
        headers.append({"Authorization": f"Bearer {text}"})
    every, *single = headers
    return [one for pair in zip([every] * len(single), single, strict=True) for one in pair]


@cache
def described() -> tuple[BaseSchema, list[Any]]:
    """Return the schema and its operations."""
    schema = schemathesis.openapi.from_dict(json.loads(OPENAPI.read_text()))
    schema.app = get_wsgi_application()
    return schema, [operation.ok() for operation in schema.get_all_operations()]


@cache
def requests_of(_who: str) -> list[tuple[Any, list[Parts]]]:
    """Return each operation with the parts of the requests that are generated for it."""
    return [(operation, drawn(operation.as_strategy())) for operation in described()[1]]


def drawn(strategy: Any) -> list[Parts]:
    found: list[Parts] = []

    @settings(
        max_examples=math.ceil(EXAMPLES_SHARE * settings.default.max_examples),
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=strategy)
    def draw(case: schemathesis.Case) -> None:
        parts = {part: getattr(case, part) for part in PARTS}
        found.append({part: value for part, value in parts.items() if value is not NOT_SET})

    draw()
    return found


@pytest.fixture
def one_connection() -> Iterator[None]:
    """Keep the test's database connection open after a request, as Django's test client does."""
    for signal in (request_started, request_finished):
        signal.disconnect(close_old_connections)
    yield
    for signal in (request_started, request_finished):
        signal.connect(close_old_connections)


def known(name: str, objects: dict[str, str], methods: dict[str, tuple[str, str]]) -> dict[str, str]:
    """Return the path parameters with which the access matrix calls this operation on real objects."""
    template = re.sub(r"{(\w+)}", r"(?P<\1>[^/]+)", methods[name][1])
    found = re.fullmatch(template, filled(table()[name].path.partition("?")[0], objects))
    assert found, name
    return found.groupdict()


class Asking:
    """A person's requests, whose answers must keep to the schema. `objects`: those of the person."""

    def __init__(self, who: str, tiago: RobotProfile) -> None:
        lab = Lab(tiago)
        self.objects = lab.objects[who, "own"] if who in PEOPLE else lab.objects["operator", "other"]
        self.signed_in = [{}] if who == "nobody" else tokens(lab.people[who])
        self.done: set[str] = set()

    def __call__(self, name: str, case: schemathesis.Case, headers: dict[str, str]) -> Any:
        with undone():
            answer = case.call(headers=headers)
        assert answer.status_code != 500, (name, case)
        case.validate_response(answer, checks=list(CHECKS))
        if answer.status_code < 300:
            self.done.add(name)
        return answer


@pytest.fixture
def asking(who: str, tiago: RobotProfile, one_connection: None, monkeypatch: pytest.MonkeyPatch) -> Asking:
    monkeypatch.setattr(refusals, "record_soon", lambda _refused: None)
    monkeypatch.setattr(emergency_stop, "press_once", stopped)
    return Asking(who, tiago)


@pytest.mark.django_db
@pytest.mark.filterwarnings("ignore:StreamingHttpResponse must consume:Warning")  # only under WSGI
@pytest.mark.timeout(600)
@pytest.mark.parametrize("who", WHO)
def test_every_answer_keeps_to_the_schema(who: str, asking: Asking) -> None:
    """The requests of the access matrix, with a token that has all scopes."""
    methods, signed_in = operations(), asking.signed_in[0]
    schema, every = described()
    for operation in every:
        name = str(operation.definition.raw["operationId"])
        if name == "events":
            continue  # its answer does not end
        row, real = table()[name], known(name, asking.objects, methods)
        query = dict(parse_qsl(filled(row.path.partition("?")[2], asking.objects)))
        right = operation.Case(path_parameters=real, query=query)
        if row.body is not None:
            right.body, right.media_type = filled(row.body, asking.objects), "application/json"
        tag = '"1"'
        if row.version and not name.startswith("bookings_"):  # these have the version of a new booking
            tag = schema[operation.path]["GET"].Case(path_parameters=real).call(headers=signed_in).headers
            tag = (tag.get("etag") or ['"1"'])[0]
        answer = asking(name, right, {**signed_in, "If-Match": tag})
        if answer.status_code == 409 and answer.json()["code"] == "takes_time":
            right.query = {**query, "confirm": "yes"}
            asking(name, right, {**signed_in, "If-Match": tag})
    if who == "staff":
        away = AWAY | {name for name, row in table().items() if row.ends in (NO_LEASE, NO_PROGRAMS)}
        left = {*methods} - asking.done - away
        assert not left, f"carried out not even once: {sorted(left)}"


@pytest.mark.django_db
@pytest.mark.filterwarnings("ignore:StreamingHttpResponse must consume:Warning")  # only under WSGI
@pytest.mark.timeout(600)
@pytest.mark.parametrize("who", WHO)
def test_answers_to_made_up_requests_keep_to_the_schema(who: str, asking: Asking) -> None:
    """The examples of all operations use the tokens in turn; most of them are about real objects."""
    methods, used = operations(), set()
    turns = cycle(enumerate(asking.signed_in))
    # With `derandomize`, all people get the same examples: made once, as this takes longer than the requests.
    for operation, requests in requests_of("all" if settings.default.derandomize else who):
        name = str(operation.definition.raw["operationId"])
        if name == "events":
            continue  # its answer does not end
        real = known(name, asking.objects, methods)
        for parts in requests:
            number, headers = next(turns)
            used.add(number)
            if number % 4:  # 1 in 4: the generated path parameters
                parts = {**parts, "path_parameters": real}
            asking(name, operation.Case(**deepcopy(parts)), headers)
    assert len(used) == len(asking.signed_in)


def test_times_and_keys_of_answers_have_their_formats() -> None:
    schemas = json.loads(OPENAPI.read_text())["components"]["schemas"]
    plain = {
        (name, field)
        for name, schema in schemas.items()
        for field, described in schema.get("properties", {}).items()
        for kind in described.get("anyOf", [described])
        if kind.get("type") == "string" and "format" not in kind and "enum" not in kind
        if field.endswith("_at")
        or field in ("at", "id", "since", "until", "session", "series", "offer_until")
    }
    assert plain == {("Named", "id")}  # no UUID for people at the command line
