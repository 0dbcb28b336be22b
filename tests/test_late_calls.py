"""Calls on threads end with their test: the second test finds what the first one began."""

from __future__ import annotations

import asyncio
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import pytest
from asgiref.sync import sync_to_async

from fleet.audit.models import Record
from fleet.audit.services import record
from teleop.background.database import in_database
from tests.processes import PATIENCE_S

pytestmark = pytest.mark.django_db(transaction=True)

SLOW_S = 0.2
begun = {by: Event() for by in ("cancelled", "asgiref", "own")}
written: list[str] = []


def write_slowly(by: str) -> None:
    """Write after the test has ended, as on a busy computer."""
    begun[by].set()
    time.sleep(SLOW_S)
    record("speech.start", text=by)
    written.append(by)


async def test_a_test_ends_while_its_calls_still_write() -> None:
    awaits = [asyncio.create_task(in_database(write_slowly, "cancelled"))]  # the end of the loop cancels them
    awaits.append(asyncio.create_task(sync_to_async(write_slowly)("asgiref")))
    ThreadPoolExecutor(1).submit(write_slowly, "own")
    await asyncio.to_thread(lambda: [event.wait(PATIENCE_S) for event in begun.values()])
    assert not any(call.done() for call in awaits)


def test_the_next_test_has_none_of_their_writes() -> None:
    assert len(written) == sum(event.is_set() for event in begun.values())
    assert not Record.objects.filter(kind="speech.start").exists()
