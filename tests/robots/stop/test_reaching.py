"""A stop is sent to bridge and watchdog in parallel; the first confirmation counts."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from uuid import uuid4

import pytest

from robots.link import stop_delivery
from robots.link.connections import LinkRefused
from robots.link.stop_delivery import first_answer, reach, stop_message, wait_for
from robots.shared import wire
from robots.shared.configuration.bridge_config import LinkAddress

ROBOT = uuid4()
PATIENCE_S = 10.0


class Watchdog:
    """A watchdog's socket: it receives one datagram and answers with one."""

    def __init__(self, path: Path, answer: wire.Stopped | wire.Refused) -> None:
        self.heard: list[wire.LinkRequest] = []
        self._answer = answer
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(str(path))
        self._listener.listen()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                lane, _ = self._listener.accept()
            except OSError:
                return
            with lane:
                self.heard.append(wire.link_request(lane.recv(8192)))
                lane.send(wire.encode(self._answer))

    def close(self) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "b.sock"


@pytest.fixture
def closing() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stop_delivery, "STOP_S", PATIENCE_S)


def press(path: Path) -> wire.Stopped | wire.Refusal:
    stop = stop_message(ROBOT, "Ann", press=uuid4())
    return wait_for(reach(LinkAddress(unix_path=str(path)), stop))


def frozen_bridge(path: Path, closing: ExitStack) -> None:
    """A frozen bridge: it accepts connections and answers nothing."""
    listener = closing.enter_context(socket.socket(socket.AF_UNIX, socket.SOCK_STREAM))
    listener.bind(str(path))
    listener.listen()


def test_the_watchdog_confirms_while_the_bridge_is_frozen(
    path: Path, closing: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    frozen_bridge(path, closing)
    watchdog = Watchdog(path.with_suffix(".stop"), wire.Stopped(wire.StopState("stopping", "Ann")))
    closing.callback(watchdog.close)
    monkeypatch.setattr(stop_delivery, "STOP_S", 60.0)
    began_s = time.monotonic()
    assert isinstance(press(path), wire.Stopped)
    assert time.monotonic() - began_s < 30.0  # `press` did not wait for the bridge
    (heard,) = watchdog.heard
    assert isinstance(heard, wire.LinkStop) and heard.robot == ROBOT and heard.by == "Ann"


def test_a_bridge_that_is_frozen_and_has_no_watchdog_is_silent(
    path: Path, closing: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stop_delivery, "STOP_S", 0.2)
    frozen_bridge(path, closing)
    with pytest.raises(LinkRefused) as refused:
        press(path)
    assert refused.value.refusal.code == "bridge_silent"


def test_without_bridge_and_watchdog_the_bridge_is_down(path: Path) -> None:
    with pytest.raises(LinkRefused) as refused:
        press(path)
    assert refused.value.refusal.code == "bridge_down"


def test_a_refusal_by_the_watchdog_is_passed_on(path: Path, closing: ExitStack) -> None:
    no = wire.Refusal("other_robot", "Another robot’s.", "robot")
    watchdog = Watchdog(path.with_suffix(".stop"), wire.Refused("link_stop", no))
    closing.callback(watchdog.close)
    assert press(path) == no


def test_names_and_reasons_of_any_length_are_sent() -> None:
    stop = stop_message(ROBOT, "n" * 1000, "r" * 1000)
    assert wire.link_request(wire.encode(stop)) == stop


async def test_the_answer_has_the_bridges_number() -> None:
    numbered = wire.Stopped(wire.StopState("stopping", number=7))
    asked = asyncio.Event()

    async def watchdog() -> wire.Stopped:
        asked.set()
        return wire.Stopped(wire.StopState("stopping"))

    async def bridge() -> wire.Stopped:
        await asked.wait()
        await asyncio.sleep(0)
        return numbered

    async def silent() -> wire.Stopped:
        await asyncio.Event().wait()
        raise AssertionError

    assert await first_answer([bridge(), watchdog()], 5.0) is numbered
    unnumbered = await first_answer([watchdog(), silent()], 60.0)  # soon: not after 60 s
    assert isinstance(unnumbered, wire.Stopped)
