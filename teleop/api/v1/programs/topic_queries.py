"""One question about a robot's topics, by the protocol of the page's Topics tab."""

from __future__ import annotations

import asyncio
import time
from typing import Any, TypeVar

from msgspec import Struct, structs
from websockets.exceptions import ConnectionClosed

from robots.shared import wire
from robots.shared.wire import NotDone, Refusal, Refused, Sample, Subscribe, TopicQuery, kind_of
from teleop.api.v1.programs.connection import GONE, ProgramSignIn, open_socket

ANSWER_S = 12.0  # the inspector may have to start
MESSAGE_S = 6.0

T = TypeVar("T", bound=Struct)

_SILENT = Refusal("no_answer", "The robot’s topics did not answer in time. Try again.", "robot")
_NO_MESSAGE = Refusal("no_message", "No message came on this topic within 6 s.", "robot")


async def ask(path: str, slug: str, sign_in: ProgramSignIn, query: TopicQuery, answer: type[T]) -> T:
    """Send one query, and return its answer. Raises `NotDone`."""
    found = await _exchange(path, slug, sign_in, structs.replace(query, seq=1), answer, ANSWER_S, _SILENT)
    assert isinstance(found, answer)  # noqa: S101 - `_exchange` waits for this type
    return found


async def one_message(path: str, slug: str, sign_in: ProgramSignIn, topic: str) -> Sample:
    """Return one message of a topic. Raises `NotDone`: none came, or it cannot be shown."""
    sample = await _exchange(path, slug, sign_in, Subscribe(topic), Sample, MESSAGE_S, _NO_MESSAGE)
    assert isinstance(sample, Sample)  # noqa: S101 - `_exchange` waits for this type
    if sample.refusal is not None:
        raise NotDone(sample.refusal)
    return sample


async def _exchange(
    path: str,
    slug: str,
    sign_in: ProgramSignIn,
    message: Any,
    answer: type[Struct],
    within_s: float,
    late: Refusal,
) -> Any:
    raw = wire.encode(message)
    wire.topics_message(raw)  # a message that is not valid is refused here
    until_s = time.monotonic() + within_s
    socket = await open_socket(path, f"/ws/robots/{slug}/topics/", sign_in)
    try:
        await socket.send(raw.decode())
        while True:
            report = wire.topics_report(
                await asyncio.wait_for(socket.recv(), max(0.0, until_s - time.monotonic()))
            )
            if isinstance(report, Refused) and report.of == kind_of(message):
                raise NotDone(report.refusal)
            if isinstance(report, Sample) and report.refusal is None and not report.number:
                await socket.send(wire.encode(wire.Ack()).decode())  # no message came on the topic yet
            elif isinstance(report, answer):
                return report
    except TimeoutError as error:
        raise NotDone(late) from error
    except (OSError, ConnectionClosed) as error:
        raise NotDone(GONE) from error
    finally:
        await socket.close()
