"""A client generated from the committed schema uses a robot, and reads all its actions from the log."""

from __future__ import annotations

import importlib
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from script.generate.messages import OPENAPI
from script.stack.stack import Stack
from tests.script.programs.test_programs import ROBOT
from tests.script.support import token


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The name of the generated package."""
    directory = tmp_path_factory.mktemp("client")
    command = Path(sys.executable).with_name("openapi-python-client")
    words = [
        "generate",
        "--path",
        str(OPENAPI),
        "--output-path",
        str(directory / "fleet_client"),
        "--meta",
        "none",
    ]
    subprocess.run([command, *words], check=True, capture_output=True)
    sys.path.insert(0, str(directory))
    yield "fleet_client"
    sys.path.remove(str(directory))


def test_a_generated_client_does_a_days_work(stack: Stack, package: str) -> None:
    text = token(stack, "operator", "read", "drive", "speak", "motions", "book", name="generated")
    client = importlib.import_module(package).AuthenticatedClient(
        base_url=stack.url, token=text, timeout=40.0
    )
    models = importlib.import_module(f"{package}.models")

    def call(tag: str, name: str, *path: Any, **values: Any) -> Any:
        operation = importlib.import_module(f"{package}.api.{tag}.{name}")
        answer = operation.sync_detailed(*path, client=client, **values)
        assert answer.status_code < 300, (name, answer.content)
        return answer.parsed

    def done(task: Any) -> Any:
        return call("tasks", "tasks_read", ROBOT, task.number, wait=30)

    assert call("control", "control_take", ROBOT, body=models.TakeControl()).state == "yours"
    tasks = []
    for _ in range(4):
        for step in ({"distance_m": 0.2}, {"angle_rad": 1.5708}):
            tasks.append(done(call("control", "drive_by", ROBOT, body=models.DriveByRequest(**step))))
    words = models.SayRequest(text="The square is done.", language="en-GB")
    tasks.append(done(call("tasks", "speech_say", ROBOT, body=words)))
    for motion in ("wave", "home"):
        tasks.append(done(call("tasks", "motions_play", ROBOT, motion)))
    assert [task.outcome for task in tasks] == ["done"] * 9 + ["succeeded"] * 2
    call("control", "control_release", ROBOT)
    starts = datetime.now(UTC).replace(microsecond=0) + timedelta(hours=2)
    slot = models.BookRequest(robot=ROBOT, starts_at=starts, ends_at=starts + timedelta(hours=1))
    booked = call("bookings", "bookings_make", body=slot)
    assert call("bookings", "bookings_read", booked.id).starts_at == starts
    said = call("robots", "speech_history", ROBOT).entries
    assert said[0].text == "The square is done."
    log = {one.number: one for one in call("records", "audit_list", person="me").records}
    assert [log[task.number].ended.outcome for task in tasks] == [task.outcome for task in tasks]
    assert {"control.take", "booking.make"} <= {one.kind for one in log.values()}
