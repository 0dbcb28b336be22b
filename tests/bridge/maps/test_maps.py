"""While a person has control, the bridge fetches the robot's map; its process may fail in any way."""

from __future__ import annotations

import asyncio
import logging
import sys
from pathlib import Path

import msgspec
import psutil
import pytest

from robots.bridge.maps import map_fetch
from robots.bridge.maps.map_fetch import AGAIN_S, FRESH_S, MapFetcher, MapWanted, NoMap
from robots.shared.configuration.bridge_config import BridgeConfig, Topic
from robots.shared.geometry.poses import Pose
from robots.shared.records.record_sink import TakenMap
from tests.bridge.support import CONFIG
from tests.processes import until

MAP = Topic("/map", "nav_msgs/OccupancyGrid")
TAKEN = TakenMap(0.05, Pose(1.0, 2.0, 0.5), 3, 4, b"PNG", "digest")


def with_map(topic: Topic | None) -> BridgeConfig:
    return msgspec.structs.replace(CONFIG, topics=msgspec.structs.replace(CONFIG.topics, map=topic))


class Taker:
    """`MapFetcher` and a process that stores the request and returns the current answer."""

    def __init__(self, folder: Path, topic: Topic | None = MAP) -> None:
        self.kept: list[TakenMap] = []
        self.gone: list[str] = []
        self._asked = folder / "asked"
        self._asked.touch()
        self._answer = folder / "answer"
        script = (
            "import pathlib, sys\n"
            "asked, answer = map(pathlib.Path, sys.argv[1:])\n"
            "asked.open('ab').write(sys.stdin.buffer.read() + b'\\n')\n"
            "sys.stdout.buffer.write(answer.read_bytes())\n"
        )
        command = (sys.executable, "-S", "-c", script, str(self._asked), str(self._answer))
        self.maps = MapFetcher(with_map(topic), self.kept.append, command, self.gone.append)

    def answers(self, answer: TakenMap | NoMap | bytes) -> None:
        raw = answer if isinstance(answer, bytes) else msgspec.msgpack.encode(answer)
        self._answer.write_bytes(raw)

    @property
    def asked(self) -> list[MapWanted]:
        return [msgspec.json.decode(line, type=MapWanted) for line in self._asked.read_bytes().splitlines()]

    async def tick(self, fence: int | None, now_s: float) -> None:
        """Run a period and wait for the process, if there is one."""
        self.maps.tick(fence, now_s)
        await settled()


async def settled() -> None:
    """Wait for all background work."""
    others = asyncio.all_tasks() - {asyncio.current_task()}
    if others:
        await asyncio.wait(others, timeout=20.0)


@pytest.fixture
def taker(tmp_path):
    taker = Taker(tmp_path)
    taker.answers(TAKEN)
    return taker


async def test_no_map_is_fetched_without_control_or_map_topic(taker, tmp_path):
    await taker.tick(None, 0.0)
    await Taker(tmp_path, topic=None).tick(1, 0.0)
    assert taker.asked == []


async def test_map_is_fetched_per_session_and_every_few_minutes(taker):
    for now_s in (0.0, 1.0, FRESH_S - 1.0):
        await taker.tick(7, now_s)
    assert taker.kept == [TAKEN]
    assert taker.asked == [MapWanted(CONFIG.ros, MAP)]
    await taker.tick(7, FRESH_S)
    assert len(taker.kept) == 2
    await taker.tick(8, FRESH_S + 1.0)
    assert len(taker.kept) == 3


async def test_one_map_is_fetched_at_a_time(taker):
    taker.maps.tick(7, 0.0)
    taker.maps.tick(8, 0.1)
    await settled()
    assert len(taker.asked) == 1
    await taker.tick(8, 0.2)
    assert len(taker.kept) == 2


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (NoMap("nobody publishes /map"), "nobody publishes /map"),
        (b"", "failed"),
        (b"\xff\xff", "failed"),
        (msgspec.msgpack.encode(TAKEN)[:-1], "failed"),
        (msgspec.msgpack.encode({"type": "TakenMap", "resolution_m": "x"}), "failed"),
        (bytes(map_fetch.LARGEST_ANSWER + 1), "failed"),
    ],
)
async def test_missing_map_is_retried_and_logged_once(answer, why, taker, caplog):
    caplog.set_level(logging.INFO, map_fetch.__name__)
    taker.answers(answer)
    for now_s in (0.0, AGAIN_S - 1.0, AGAIN_S, 2.0 * AGAIN_S):
        await taker.tick(7, now_s)
    assert taker.kept == []
    assert len(taker.asked) == 3
    [said] = [line.getMessage() for line in caplog.records if line.name == map_fetch.__name__]
    assert why in said
    taker.answers(TAKEN)
    await taker.tick(7, 3.0 * AGAIN_S)
    assert taker.kept == [TAKEN]


@pytest.mark.parametrize(
    ("answer", "words"),
    [(NoMap("nobody publishes it"), "nobody publishes it"), (b"", "the console could not fetch it")],
    ids=["no map", "crash"],
)
async def test_a_known_map_is_gone_after_two_failed_fetches(answer, words, taker):
    await taker.tick(7, 0.0)
    taker.answers(answer)
    await taker.tick(7, FRESH_S)
    assert taker.gone == []
    await taker.tick(7, FRESH_S + AGAIN_S)
    assert taker.gone == [words]


async def test_a_map_that_is_not_found_at_first_is_looked_for_soon(taker):
    """On a busy computer, the map's node is found late. Until then, nobody says that the robot has none."""
    taker.answers(NoMap("nobody publishes it"))
    await taker.tick(7, 0.0)
    taker.answers(TAKEN)
    await taker.tick(7, map_fetch.DOUBTED_S)
    assert (taker.gone, taker.kept) == ([], [TAKEN])


async def test_a_known_map_is_gone_at_once_for_a_certain_reason(taker):
    await taker.tick(7, 0.0)
    taker.answers(NoMap("two nodes publish different maps", is_certain=True))
    await taker.tick(7, FRESH_S)
    assert taker.gone == ["two nodes publish different maps"]


@pytest.mark.parametrize("watched", [True, False])
async def test_a_map_lost_with_a_restart_is_gone_at_once_for_a_drive(watched, taker):
    await taker.tick(7, 0.0)
    taker.answers(NoMap("nobody publishes it"))
    for now_s in (10.0, 10.0 + map_fetch.DOUBTED_S):
        taker.maps.tick(7, now_s, watched, run=1)
        await settled()
    assert len(taker.gone) == watched


HANGS = ("sleep", "60")


def hangs() -> bool:
    """True if the hanging process exists."""
    return any(child.cmdline() == list(HANGS) for child in psutil.Process().children())


async def test_a_process_that_hangs_is_ended(tmp_path, monkeypatch, caplog):
    caplog.set_level(logging.INFO, map_fetch.__name__)
    monkeypatch.setattr(map_fetch, "END_S", 0.2)
    hanging = MapFetcher(with_map(MAP), lambda taken: None, HANGS)
    hanging.tick(7, 0.0)
    await settled()
    assert "failed" in caplog.text
    assert not hangs()


async def test_a_bridge_that_ends_waits_for_no_map():
    hanging = MapFetcher(with_map(MAP), lambda taken: None, HANGS)
    hanging.tick(7, 0.0)
    await asyncio.to_thread(until, hangs, "the process", 10.0)
    await asyncio.wait_for(hanging.close(), 5.0)
    assert not hangs()


async def test_a_process_that_cannot_start_harms_no_other(caplog):
    caplog.set_level(logging.INFO, map_fetch.__name__)
    broken = MapFetcher(with_map(MAP), lambda taken: None, ("/nowhere/nothing",))
    broken.tick(7, 0.0)
    await settled()
    assert "failed" in caplog.text
