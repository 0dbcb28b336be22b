"""Programs with tokens, and browsers, that ask the API."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make


class Caller:
    """Asks the API. `caller("GET", "/robots")` returns the answer; its JSON is in `answer.data`."""

    def __init__(self, client: Client, headers: dict[str, str]) -> None:
        self._client, self._headers = client, headers

    def __call__(self, method: str, path: str, body: Any = None, **headers: str) -> Any:
        answer = self.stream(method, path, body, **headers)
        answer.data = json.loads(answer.content) if answer.content else None
        return answer

    def stream(self, method: str, path: str, body: Any = None, **headers: str) -> Any:
        """Return the answer without reading its JSON."""
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        raw = body if isinstance(body, bytes) else b"" if body is None else json.dumps(body).encode()
        return self._client.generic(
            method, f"/api/v1{path}", raw, "application/json", headers={**self._headers, **named}
        )


@pytest.fixture
def program(db: None) -> Callable[..., Caller]:
    """`program(operator, "read", "book", robots=[robot])`: a program with a token of that person."""

    def make(person: User, *scopes: str, robots: Any = ()) -> Caller:
        _, text = token_make(
            user=person,
            name="night-tests",
            scopes=[Scope(scope) for scope in scopes or [scope.value for scope in Scope]],
            expires_at=timezone.now() + timedelta(days=1),
            actor=person,
            robots=[robot.id for robot in robots],
        )
        return Caller(Client(), {"Authorization": f"Bearer {text}"})

    return make


@pytest.fixture
def page_of(signed_in: Callable[[User], Client]) -> Callable[[User], Caller]:
    """`page_of(operator)`: that person's browser."""
    return lambda person: Caller(signed_in(person), {})
