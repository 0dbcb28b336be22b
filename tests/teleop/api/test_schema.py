"""The OpenAPI schema: committed as it is, and true for requests of all kinds."""

from __future__ import annotations

import json
from datetime import timedelta
from itertools import cycle

import pytest
import schemathesis
from django.core.wsgi import get_wsgi_application
from django.utils import timezone
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from robots.registry.models import Robot
from script.stack.messages import OPENAPI, openapi

CHECKS = (status_code_conformance, content_type_conformance, response_schema_conformance)
EXAMPLES = 5  # of each operation and person
WHO = ("staff", "supervisor", "operator", "observer", "stranger", "nobody")


def test_the_committed_schema_is_the_present_one() -> None:
    assert OPENAPI.read_text() == openapi(), "run script/messages"


def tokens(person: User) -> list[dict[str, str]]:
    """Return the headers of tokens: one with all scopes between each two with a single one."""
    expires, headers = timezone.now() + timedelta(days=1), []
    for scopes in [list(Scope), *([scope] for scope in Scope)]:
        _, text = token_make(user=person, name="fuzz", scopes=scopes, expires_at=expires, actor=person)
        headers.append({"Authorization": f"Bearer {text}"})
    every, *single = headers
    return [one for pair in zip([every] * len(single), single, strict=True) for one in pair]


@pytest.mark.django_db(transaction=True)
@pytest.mark.filterwarnings("ignore:StreamingHttpResponse must consume:Warning")  # under ASGI it need not
@pytest.mark.parametrize("who", WHO)
def test_every_answer_keeps_to_the_schema(who: str, robot: Robot, request: pytest.FixtureRequest) -> None:
    """All scopes and each single one, in turns over the examples of all operations."""
    signed_in = [{}] if who == "nobody" else tokens(request.getfixturevalue(who))
    turns, used = cycle(enumerate(signed_in)), set()
    schema = schemathesis.openapi.from_dict(json.loads(openapi()))
    schema.app = get_wsgi_application()
    for found in schema.get_all_operations():
        operation = found.ok()
        if operation.path.endswith("/events"):
            continue  # its answer does not end

        @settings(
            max_examples=EXAMPLES,
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy())
        def check(case: schemathesis.Case) -> None:
            if "slug" in case.path_parameters:
                case.path_parameters["slug"] = robot.slug
            number, headers = next(turns)
            used.add(number)
            answer = case.call(headers=headers)
            assert answer.status_code != 500
            case.validate_response(answer, checks=list(CHECKS))

        check()
    assert len(used) == len(signed_in)


def test_times_and_keys_of_answers_have_their_formats() -> None:
    schemas = json.loads(openapi())["components"]["schemas"]
    plain = {
        (name, field)
        for name, schema in schemas.items()
        for field, described in schema.get("properties", {}).items()
        for kind in described.get("anyOf", [described])
        if kind.get("type") == "string" and "format" not in kind and "enum" not in kind
        if field.endswith("_at")
        or field in ("at", "id", "since", "until", "session", "series", "offer_until")
    }
    assert plain == {("Named", "id")}  # also of people at the command line, who have no account
