"""Refusals of the API: a request gets each code of the table in docs/api.md, and there are no other codes."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Awaitable, Callable, Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from django.test import Client
from django.utils import timezone
from websockets.asyncio.server import ServerConnection, unix_serve

import teleop.api
from fleet.accounts.models import User
from fleet.accounts.sign_in import second_factor
from fleet.accounts.tokens.models import Scope
from fleet.accounts.tokens.services import token_make
from robots.registry.models import Robot
from robots.shared import wire
from teleop.api.v1.framework import idempotency, rates
from teleop.api.v1.programs import camera_pictures, connection, registry, topic_queries
from teleop.api.v1.robot import tasks, topics
from teleop.background.database import in_database
from teleop.models import KeyedRequest
from tests.teleop.api.test_bookings import hour, words
from tests.teleop.api.test_program_connections import usual

pytestmark = pytest.mark.django_db(transaction=True)

DOCS = Path(__file__).parents[3] / "docs" / "api.md"
FAR = {"starts_at": "2300-01-01T00:00:00Z", "ends_at": "2300-01-01T01:00:00Z"}
SLOT = {"starts_at": words(hour(1)), "ends_at": words(hour(2))}
# Codes of other parts of the console that are in the same table.
OF_ACCOUNTS = {"token_invalid", "token_expired", "account_inactive", "second_factor_missing", "scope_missing"}
OF_WEBHOOKS = {"paused"}
OF_NAMES = {
    "name_unseen",
    "name_mixed",
    "name_alike",
    "name_reserved",
}  # `tests.teleop.api.test_names_at_doors`
OF_BOUNDS = {"too_many_changes", "too_many_keys"}  # `tests.teleop.api.test_bounds`
# Codes of a single operation are tested with that operation.
WITH_THEIR_OPERATIONS = {
    *("too_many", "more_than_own", "other_robots", "paused", "name_taken", "password_needed"),
    "bad_description",
    "other_process",
    "mail_off",
    *("takes_time", "preview"),
}
# `tests.teleop.recordings.test_shelf`, `test_object_store`
OF_STORES = {"recording_away", "recording_lost", "store_away"}
OF_THE_LIBRARY = {"method_not_allowed", "not_acceptable", "unsupported_media_type"}


def documented() -> set[str]:
    """Return the codes of the table in the docs."""
    table = DOCS.read_text().partition("The API has these codes:")[2]
    rows = [line.split("|") for line in table.splitlines() if re.match(r"\| \d", line)]
    return {code for row in rows for code in re.findall(r"`([a-z0-9_]+)`", row[2])}


def built() -> Iterator[str]:
    """Yield the codes of refusals that the API builds."""
    for path in Path(teleop.api.__path__[0]).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            match node:
                case ast.Call(func=ast.Name("Refusal"), args=[ast.Constant(str(code)), *_]):
                    yield code


def test_each_code_of_the_api_stands_in_the_docs() -> None:
    elsewhere = OF_ACCOUNTS | OF_WEBHOOKS | OF_NAMES | OF_BOUNDS | OF_STORES | OF_THE_LIBRARY
    assert {*built(), *elsewhere} == documented()


class Asker:
    """Asks the API as the operator, with a token of all scopes unless `headers` has another."""

    def __init__(self, person: User, patch: pytest.MonkeyPatch, path: Path) -> None:
        self.person, self.patch, self.path = person, patch, path
        self.mute: set[type] = set()  # messages that the driving process does not answer

    def token(self, *scopes: Scope, days: float = 1.0, **options: Any) -> dict[str, str]:
        expires = timezone.now() + timedelta(days=days)
        name = str(KeyedRequest.objects.count())
        _, text = token_make(
            user=self.person, name=name, scopes=scopes, expires_at=expires, actor=self.person, **options
        )
        return {"Authorization": f"Bearer {text}"}

    async def __call__(
        self, method: str, path: str, body: Any = None, headers: dict[str, str] | None = None, **more: str
    ) -> str:
        """Return the code of the refusal; "" if there is none."""
        if not hasattr(self, "all"):
            self.all = await in_database(self.token, *Scope)
        raw = body if isinstance(body, bytes) else b"" if body is None else json.dumps(body).encode()
        kind = more.pop("kind", "application/json")
        named = {name.replace("_", "-"): value for name, value in more.items()}
        whole = {**(self.all if headers is None else headers), **named}
        answer = await in_database(
            lambda: Client().generic(method, f"/api/v1{path}", raw, kind, headers=whole)
        )
        return "" if answer.status_code < 400 else str(json.loads(answer.content)["code"])

    async def serve(self, socket: ServerConnection) -> None:
        """Answer as the web process does."""
        async for raw in socket:
            if socket.request is not None and re.search("/(topics|camera)/", socket.request.path):
                continue
            message: object = wire.browser_message(raw)
            if type(message) in self.mute:
                continue
            if isinstance(message, wire.Release):
                await socket.close()
            for answer in usual(message):
                await socket.send(wire.encode(answer).decode())  # type: ignore[arg-type]


@pytest.fixture
def ask(operator: User, robot: Robot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Asker:
    return Asker(operator, monkeypatch, tmp_path / "s")


ROBOT = "/robots/tiago-1"
SAY = {"text": "Hello", "language": "en-GB"}
Case = Callable[[Asker], Awaitable[str]]


def sends(method: str, path: str, body: Any = None, **more: Any) -> Case:
    """Return a case that sends one request."""
    return lambda ask: ask(method, path, body, **more)


async def with_token(ask: Asker, *scopes: Scope, **options: Any) -> str:
    return await ask("GET", "/robots", headers=await in_database(lambda: ask.token(*scopes, **options)))


async def account_inactive(ask: Asker) -> str:
    headers = await in_database(ask.token, Scope.READ)
    await in_database(lambda: User.objects.filter(pk=ask.person.pk).update(is_active=False))
    return await ask("GET", "/robots", headers=headers)


async def second_factor_missing(ask: Asker) -> str:
    ask.patch.setattr(second_factor, "is_missing", lambda _user: True)
    return await with_token(ask, Scope.READ)


async def robot_needed(ask: Asker) -> str:
    robots = await in_database(lambda: list(Robot.objects.values_list("pk", flat=True)))
    headers = await in_database(lambda: ask.token(Scope.READ, robots=[*robots, ask.person.pk]))
    return await ask("GET", "/audit", headers=headers)


async def changed(ask: Asker) -> str:
    await in_database(lambda: User.objects.filter(pk=ask.person.pk).update(is_staff=True))
    return await ask("PATCH", f"/registry{ROBOT[7:]}", {}, If_Match='"0"')


async def if_match_missing(ask: Asker) -> str:
    await in_database(lambda: User.objects.filter(pk=ask.person.pk).update(is_staff=True))
    return await ask("PATCH", f"/registry{ROBOT[7:]}", {})


async def key_reused(ask: Asker) -> str:
    await ask("POST", "/bookings", {"robot": "tiago-1", **SLOT}, Idempotency_Key="k")
    return await ask("POST", "/bookings", {"robot": "tiago-1", **FAR}, Idempotency_Key="k")


async def claimed(ask: Asker, age_s: float) -> str:
    """Repeat a key whose first request has no answer yet."""
    ask.patch.setattr(idempotency, "WAIT_S", 0.0)
    await ask("POST", "/bookings", {"robot": "tiago-1", **SLOT}, Idempotency_Key="k")
    began = timezone.now() - timedelta(seconds=age_s)
    await in_database(lambda: KeyedRequest.objects.update(status=None, made_at=began))
    return await ask("POST", "/bookings", {"robot": "tiago-1", **SLOT}, Idempotency_Key="k")


async def too_often(ask: Asker) -> str:
    ask.patch.setattr(rates, "BURST", 1.0)
    ask.patch.setattr(rates, "PER_S", 0.001)
    return await ask("GET", "/robots") or await ask("GET", "/robots")


async def busy(ask: Asker) -> str:
    for _ in range(topics.MOST_ASKING):
        assert topics._asking.acquire(blocking=False)
    try:
        return await ask("GET", f"{ROBOT}/topics")
    finally:
        for _ in range(topics.MOST_ASKING):
            topics._asking.release()


async def not_connected(ask: Asker) -> str:
    ask.patch.setenv(registry.SOCKET, str(ask.path))
    return await ask("POST", f"{ROBOT}/control", {})


async def served(ask: Asker, *steps: Case) -> str:
    """Run the steps one after the other, with a web process; return the last code."""
    ask.patch.setenv(registry.SOCKET, str(ask.path))
    ask.patch.setattr(registry, "programs", registry.programs)
    code = ""
    async with unix_serve(ask.serve, str(ask.path)):
        for step in steps:
            code = await step(ask)
        for entry in registry.programs._entries.values():
            if entry.connection:
                await entry.connection.close()
    return code


TAKE = sends("POST", f"{ROBOT}/control", {})


async def connection_lost(ask: Asker) -> str:
    return await served(ask, TAKE, sends("DELETE", f"{ROBOT}/control"))


async def no_answer(ask: Asker) -> str:
    ask.patch.setattr(connection, "ANSWER_S", 0.2)
    ask.mute = {wire.Hello}
    return await served(ask, TAKE)


async def no_message(ask: Asker) -> str:
    ask.patch.setattr(topic_queries, "MESSAGE_S", 0.2)
    return await served(ask, sends("GET", f"{ROBOT}/topics/message?topic=/a"))


async def camera_silent(ask: Asker) -> str:
    ask.patch.setattr(camera_pictures, "PICTURE_S", 0.2)
    return await served(ask, sends("GET", f"{ROBOT}/cameras/head/picture"))


async def not_recorded(ask: Asker) -> str:
    return await served(ask, TAKE, sends("POST", f"{ROBOT}/speech", SAY))


async def cancelled(ask: Asker) -> str:
    """Cancel a task while it begins. A second task of its kind is refused at once."""
    newest = tasks.newest_record

    def is_overtaken() -> int:
        second = Client().post(f"/api/v1{ROBOT}/speech", SAY, "application/json", headers=ask.all)
        assert (second.status_code, second.json()["code"]) == (429, "busy")
        Client().delete(f"/api/v1{ROBOT}/speech", headers=ask.all)
        return newest()

    ask.patch.setattr(connection, "ANSWER_S", 0.2)
    ask.patch.setattr(tasks, "newest_record", is_overtaken)
    return await served(ask, TAKE, sends("POST", f"{ROBOT}/speech", SAY))


async def not_cleared(ask: Asker) -> str:
    ask.patch.setattr(tasks, "CLEARED_S", 0.0)
    return await served(ask, sends("POST", f"{ROBOT}/stop/clear", {"number": 1}))


CASES: dict[str, Case] = {
    "invalid": sends("POST", f"{ROBOT}/velocity", {"forwards": 1}),
    "not_json": sends("POST", f"{ROBOT}/velocity", b"{"),
    "not_utf8": sends("POST", f"{ROBOT}/velocity", b'{"a": "\xfc"}'),
    "duplicate_field": sends("POST", f"{ROBOT}/velocity", b'{"seconds": 0.1, "seconds": 0.1}'),
    "too_deep": sends("POST", f"{ROBOT}/velocity", b"[" * 40 + b"]" * 40),
    "too_large": sends("POST", f"{ROBOT}/velocity", b'"' + b"x" * 70000 + b'"'),
    "too_fast": lambda ask: served(ask, TAKE, sends("POST", f"{ROBOT}/velocity", {"forward_mps": 4.0})),
    "wrong_year": sends("POST", "/bookings", {"robot": "tiago-1", **FAR}),
    "robot_needed": robot_needed,
    "signed_out": sends("GET", "/robots", headers={}),
    "token_invalid": sends("GET", "/robots", headers={"Authorization": "Bearer fleet_x"}),
    "token_expired": lambda ask: with_token(ask, Scope.READ, days=-1.0),
    "account_inactive": account_inactive,
    "second_factor_missing": second_factor_missing,
    "scope_missing": lambda ask: with_token(ask, Scope.BOOK),
    "permission_denied": sends("POST", "/audit/export"),
    "not_found": sends("GET", "/robots/nobodys"),
    "method_not_allowed": sends("PUT", "/robots"),
    "not_acceptable": sends("GET", "/robots", Accept="application/xml"),
    "unsupported_media_type": sends("POST", f"{ROBOT}/velocity", b"a=b", kind="text/plain"),
    "no_lease": sends("POST", f"{ROBOT}/speech", SAY),
    "cancelled": cancelled,
    "not_cleared": not_cleared,
    "no_message": no_message,
    "in_progress": lambda ask: claimed(ask, 1.0),
    "outcome_unknown": lambda ask: claimed(ask, 100.0),
    "changed": changed,
    "if_match_missing": if_match_missing,
    "key_reused": key_reused,
    "too_often": too_often,
    "busy": busy,
    "no_programs": TAKE,
    "not_connected": not_connected,
    "connection_lost": connection_lost,
    "no_answer": no_answer,
    "not_recorded": not_recorded,
    "no_camera": sends("GET", f"{ROBOT}/cameras/none/picture"),
    "camera_silent": camera_silent,
}


def test_each_code_of_the_docs_is_asked_for() -> None:
    assert {*CASES, *WITH_THEIR_OPERATIONS, *OF_NAMES, *OF_BOUNDS, *OF_STORES} == documented()


@pytest.mark.parametrize("code", sorted(CASES))
async def test_bad_input_gets_its_code(code: str, ask: Asker) -> None:
    assert await CASES[code](ask) == code
