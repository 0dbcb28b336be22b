"""A program's connection to a robot's control, with a server whose answers the test decides."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from uuid import uuid4

import pytest
from websockets.asyncio.server import ServerConnection, unix_serve

from robots.shared import wire
from robots.shared.wire import Accepted, Control, NotDone, Refusal, Refused, encode
from teleop.api.v1.programs import connection, registry
from teleop.api.v1.programs.connection import ProgramConnection, ProgramSignIn, Velocity
from tests.teleop.support import eventually

FREE = Control("free")
YOURS = Control("yours", holder="Olga (test)", fence=7, session=str(uuid4()), remaining_s=100.0)
OTHER = Control("other", holder="Somebody")

Answers = Callable[[object], Iterator[object]]


def sign_in() -> ProgramSignIn:
    return ProgramSignIn(f"token:{uuid4()}", uuid4(), (("Authorization", "Bearer x"),), "localhost", None)


def usual(message: object) -> Iterator[object]:
    """Answer as the console usually does."""
    match message:
        case wire.Hello():
            yield FREE
        case wire.Take():
            yield YOURS
        case wire.Say(seq=seq):
            yield Accepted("say", seq)


@asynccontextmanager
async def served(path: Path, answers: Answers = usual) -> AsyncIterator[list[object]]:
    """Serve at `path`; yield the list of received messages."""
    heard: list[object] = []

    async def serve(socket: ServerConnection) -> None:
        async for raw in socket:
            message: object = wire.browser_message(raw)
            heard.append(message)
            for answer in answers(message):
                await socket.send(encode(answer).decode())  # type: ignore[arg-type]

    async with unix_serve(serve, str(path)):
        yield heard


def ways(heard: list[object]) -> list[float]:
    return [one.x for one in heard if isinstance(one, wire.Drive)]


async def opened(path: Path) -> ProgramConnection:
    return await ProgramConnection.open(str(path), "tiago-1", sign_in())


async def test_the_answer_to_a_take_is_not_the_change_of_somebody_else(tmp_path: Path) -> None:
    def busy(message: object) -> Iterator[object]:
        if isinstance(message, wire.Take):
            yield OTHER  # another person took control just before
            yield FREE
        yield from usual(message)

    async with served(tmp_path / "s", busy):
        program = await opened(tmp_path / "s")
        assert (await program.change(wire.Take())).fence == 7
        await program.close()


async def test_a_hello_that_is_refused_is_answered_at_once(tmp_path: Path) -> None:
    def refuses(_message: object) -> Iterator[object]:
        yield Refused("hello", Refusal("flood", "Too many messages.", "wire"))

    async with served(tmp_path / "s", refuses):
        began_s = time.monotonic()
        with pytest.raises(NotDone) as caught:
            await opened(tmp_path / "s")
        assert caught.value.refusal.code == "flood"
        assert time.monotonic() - began_s < connection.ANSWER_S


async def test_a_message_that_does_not_fit_ends_no_control(tmp_path: Path) -> None:
    async with served(tmp_path / "s") as heard:
        program = await opened(tmp_path / "s")
        await program.change(wire.Take())
        numbers = {"data": [1e15] * 5000}  # 5 characters each in the request, 18 in the message
        for fields, topic, code in ((numbers, "/a", "too_large"), ({}, "no topic", "invalid")):
            with pytest.raises(NotDone) as caught:
                await program.request(
                    lambda fence, seq, fields=fields, topic=topic: wire.Publish(  # type: ignore[misc]
                        fence, topic, "std_msgs/Float64MultiArray", fields, 0.0, 1.0, seq
                    )
                )
            assert caught.value.refusal.code == code
        await program.request(lambda fence, seq: wire.Say(fence, "Hello", "en-GB", None, seq))
        assert [type(one) for one in heard] == [wire.Hello, wire.Take, wire.Say]
        await program.close()


async def test_a_new_velocity_takes_the_place_of_the_old(tmp_path: Path) -> None:
    """A velocity that waited for the one before would be old when it drives the robot."""
    async with served(tmp_path / "s") as heard:
        program = await opened(tmp_path / "s")
        await program.change(wire.Take())
        first = asyncio.create_task(program.drive(Velocity(1.0, 0.0, 0.0, 1.0), 5.0))
        await eventually(lambda: ways(heard))
        second = await program.drive(Velocity(-1.0, 0.0, 0.0, 1.0), 0.2)
        assert second >= 0.2
        assert await first < 2.0
        driven = await eventually(lambda: found if (found := ways(heard))[-1] == 0.0 else None)
        assert 1.0 not in driven[driven.index(-1.0) :]
        await program.close()


@pytest.mark.parametrize(("because", "goes_on"), [("control_taken", True), ("behind_unseen", False)])
async def test_a_call_says_by_itself_that_nothing_is_asked(
    tmp_path: Path, because: str, goes_on: bool
) -> None:
    """But only a second call says that somebody has looked behind the robot."""
    is_neutral = False

    def needs_neutral(message: object) -> Iterator[object]:
        nonlocal is_neutral
        if isinstance(message, wire.Drive):
            is_neutral = is_neutral or message.x == 0.0
            if not is_neutral:
                figures = {"because": because, "why": "nobody has looked"}
                text = "Let the stick return to the middle: nobody has looked."
                yield Refused("drive", Refusal("neutral_needed", text, "dead-man", figures))
        yield from usual(message)

    async with served(tmp_path / "s", needs_neutral) as heard:
        program = await opened(tmp_path / "s")
        await program.change(wire.Take())
        if goes_on:
            await program.drive(Velocity(-1.0, 0.0, 0.0, 1.0), 0.3)
        else:
            with pytest.raises(NotDone) as caught:
                await program.drive(Velocity(-1.0, 0.0, 0.0, 1.0), 0.3)
            assert caught.value.refusal.figures["because"] == because
            assert caught.value.refusal.text == "Nobody has looked."  # a program has no stick
        driven = await eventually(lambda: found if (found := ways(heard))[-1] == 0.0 else None)
        assert (-1.0 in driven[driven.index(0.0) :]) == goes_on
        await program.close()


async def test_the_seconds_of_control_run_down(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with served(tmp_path / "s"):
        program = await opened(tmp_path / "s")
        await program.change(wire.Take())
        now_s = time.monotonic()
        with monkeypatch.context() as patch:
            patch.setattr(connection, "time", SimpleNamespace(monotonic=lambda: now_s + 40.0))
            control = program.control
        assert control is not None
        assert control.remaining_s == pytest.approx(60.0, abs=1.0)
        await program.close()


async def test_one_person_does_not_take_all_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(registry.SOCKET, str(tmp_path / "s"))
    monkeypatch.setattr(registry, "MOST_OF_PERSON", 2)
    programs, mine, theirs = registry.Programs(), sign_in(), sign_in()
    async with served(tmp_path / "s"):
        kept = [await programs.connection(slug, mine) for slug in ("a", "b")]
        with pytest.raises(NotDone) as caught:
            await programs.connection("c", mine)
        assert caught.value.refusal.code == "busy"
        assert await programs.connection("a", mine) is kept[0]
        await programs.connection("c", theirs)
        monkeypatch.setattr(registry, "UNUSED_S", 0.0)
        await eventually(lambda: not any(one.is_open for one in kept))


async def test_requests_at_once_share_one_connection(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(registry.SOCKET, str(tmp_path / "s"))
    programs, mine = registry.Programs(), sign_in()
    async with served(tmp_path / "s") as heard:
        found = await asyncio.gather(*(programs.connection("a", mine) for _ in range(10)))
        assert len({id(one) for one in found}) == 1
        assert len(heard) == 1
        await found[0].close()
        assert await programs.connection("a", mine) is not found[0]
        monkeypatch.setattr(registry, "UNUSED_S", 0.0)
        await eventually(lambda: not programs._entries)
