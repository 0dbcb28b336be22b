"""Tasks in REST: a request is sent and gets an address, where a program reads its outcome; a cancel is sent."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from asgiref.sync import sync_to_async

from fleet.accounts.models import User
from fleet.audit.services import record
from robots.registry.models import Robot
from robots.shared import wire
from teleop.api.v1.robot.tasks import TasksBase
from tests.teleop.api.conftest import Caller

pytestmark = pytest.mark.django_db

BODIES = {
    "speech": {"text": "Hi", "language": "en"},
    "motions/wave": None,
    "gripper": {"width_m": 0.05},
    "torso": {"height_m": 0.1},
    "drive-by": {"distance_m": 1.0},
    "go": {"x": 2.0, "y": 1.0},
}


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch, robot: Robot, operator: User) -> list[Any]:
    """The messages to a bridge that records each task; this test has no bridge."""
    messages: list[Any] = []
    of_task = {kind.request: kind for kind in wire.TASK_KINDS}

    async def request(make: Any) -> None:
        message = make(7, 1)
        messages.append(message)
        if kind := of_task.get(type(message)):
            await sync_to_async(record)(kind.record, actor=operator, robot_id=robot.id)

    connection = SimpleNamespace(request=request, control=None, starting={}, cancelled_s={})
    monkeypatch.setattr(TasksBase, "connected", lambda _view, _robot: connection)
    return messages


@pytest.mark.parametrize("address", BODIES)
def test_a_task_has_an_address_and_a_cancel(
    address: str, program: Callable[..., Caller], operator: User, robot: Robot, sent: list[Any]
) -> None:
    ask = program(operator)
    begun = ask("POST", f"/robots/{robot.slug}/{address}", BODIES[address])
    [request] = sent
    kind = next(kind for kind in wire.TASK_KINDS if kind.request is type(request))
    assert begun.status_code == 202
    assert ask("GET", begun.headers["Location"].removeprefix("/api/v1")).data["kind"] == kind.name
    cancelled = ask("DELETE", f"/robots/{robot.slug}/{address.replace('motions/wave', 'motion')}")
    assert (cancelled.status_code, type(sent[1])) == (204, kind.cancel)
