"""Recordings whose files are on another computer, whose shelf hands them out over TLS."""

from __future__ import annotations

import asyncio
import io
import shutil
import socket
import threading
import time
from collections.abc import Coroutine, Iterator
from pathlib import Path
from typing import Any, TypeVar

import psutil
import pytest
from mcap.reader import make_reader
from msgspec import structs
from websockets.exceptions import ConnectionClosed

from fleet.accounts.models import User
from robots.bridge.recorder.files.directory import RecordingDirectory
from robots.bridge.served.client import SHELF, ProcessClient
from robots.bridge.server.link_server import Link, LinkServer
from robots.link import shelf_link
from robots.link.connections import open_sync
from robots.recordings import shelf_file
from robots.recordings.models import Recording
from robots.registry.models import Robot
from robots.registry.selectors import bridge_config, link_address
from robots.shared import wire
from robots.shared.configuration.bridge_config import BridgeConfig
from robots.shared.wire import ShelfRead
from tests.processes import PATIENCE_S, free_port
from tests.robots.recordings.samples import sample
from tests.teleop.recordings.test_door import content, get
from tests.teleop.recordings.test_sight import BEGAN, session

pytestmark = pytest.mark.django_db
T = TypeVar("T")
HOST = "127.0.0.2"
PICTURE = b"\xff\xd8 a picture"


class BridgeHost:
    """A computer with a bridge: its link, and its shelf while a web process needs it."""

    def __init__(self, config: BridgeConfig) -> None:
        self._config = config
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.start()
        self.wait(self._start())

    def wait(self, work: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE_S)

    async def _start(self) -> None:
        self.shelf = ProcessClient(self._config, SHELF)
        self._links = LinkServer(self._config.link, self._opened, self._message, self.shelf.forget)
        await self._links.start()

    def _opened(self, link: Link) -> None:
        link.report(wire.BridgeHello(wire.PROTOCOL, self._config.robot_id, self._config.slug, 0))

    async def _message(self, link: Link, raw: bytes) -> None:
        message = wire.link_request(raw)
        assert isinstance(message, wire.LinkProcess)
        self.shelf.set_wanted(link, message.wanted)

    def close(self) -> None:
        async def end() -> None:
            await self._links.close()
            await self.shelf.close()

        self.wait(end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


def shelves() -> list[psutil.Process]:
    children = psutil.Process().children()
    return [child for child in children if "robots.bridge.recorder.shelf" in child.cmdline()]


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """The directory of the other computer."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    return folder


@pytest.fixture
def config(robot: Robot, settings: Any, tmp_path: Path, elsewhere: Path) -> BridgeConfig:
    """The configuration of the robot's bridge, which is reached over the network only."""
    settings.FLEET_VAR, settings.FLEET_BRIDGE_HOST, settings.FLEET_LINK_SECRET = tmp_path, HOST, "s" * 40
    settings.FLEET_RECORDINGS = elsewhere
    robot.bridge_address = f"wss://{HOST}:{free_port()}"
    robot.save()
    config = bridge_config(robot)
    return structs.replace(config, link=structs.replace(config.link, unix_path=None))


@pytest.fixture
def host(config: BridgeConfig, monkeypatch: pytest.MonkeyPatch) -> Iterator[BridgeHost]:
    monkeypatch.setattr(shelf_file, "_silent_until_s", {})
    monkeypatch.setattr(shelf_link, "OPEN_S", PATIENCE_S)  # this computer may be busy
    running = BridgeHost(config)
    yield running
    running.close()


@pytest.fixture
def recording(robot: Robot, operator: User, config: BridgeConfig, elsewhere: Path) -> Recording:
    """Five minutes of the operator; its file has some blocks of a shelf."""
    data = sample(300, begins_s=int(BEGAN.timestamp())).getvalue()
    made = Recording.objects.create(
        robot=robot,
        person=operator,
        kind="black_box",
        begins_at=BEGAN,
        ends_at=BEGAN + (session(robot, operator, -1, 10).ended_at - BEGAN) / 2,
        directory="/nowhere/on/this/computer",
        bytes=len(data),
        thumbnail=True,
        file="named-below.mcap",
    )
    made.file = f"20261102T090000Z-black_box-{made.pk}.mcap"
    made.save()
    (elsewhere / made.file).write_bytes(data)
    (elsewhere / made.file).with_suffix(".jpg").write_bytes(PICTURE)
    return made


@pytest.fixture
def data(recording: Recording, elsewhere: Path) -> bytes:
    return (elsewhere / recording.file).read_bytes()


def test_a_recording_elsewhere_is_replayed_and_cut(
    recording: Recording, operator: User, host: BridgeHost
) -> None:
    [odom] = [
        one for one in get(operator, recording).json()["contents"]["channels"] if one["topic"] == "/odom"
    ]
    assert odom["messages"] == 3000
    views = get(operator, recording, "/views?from=200&to=204").json()["views"]
    assert [at for at, *_ in views] == [round(200 + tick / 10, 1) for tick in range(41)]
    assert content(get(operator, recording, "/thumbnail")) == PICTURE
    part = io.BytesIO(content(get(operator, recording, "/file?from=100&to=101&topics=/odom")))
    assert len(list(make_reader(part).iter_messages())) == 11
    assert content(get(operator, recording, "/file?format=bag&topics=/odom")).startswith(b"#ROSBAG")


def test_a_download_goes_on_after_breaks_and_kills(
    recording: Recording, operator: User, host: BridgeHost, data: bytes
) -> None:
    step = len(data) // 20 + 1
    got = b""
    while len(got) < len(data):
        if len(got) == 10 * step:
            [shelf] = shelves()
            shelf.kill()
        part = get(operator, recording, "/file", Range=f"bytes={len(got)}-{len(got) + step - 1}")
        assert part.status_code == 206
        got += content(part)
    assert got == data
    answer: Any = get(operator, recording, "/file")
    pieces = iter(answer.streaming_content)
    got = next(pieces)
    [shelf] = shelves()
    shelf.kill()
    assert got + b"".join(pieces) == data


def test_a_host_that_goes_away_is_said(
    recording: Recording, operator: User, config: BridgeConfig, data: bytes
) -> None:
    host = BridgeHost(config)
    answer: Any = get(operator, recording, "/file")
    pieces = iter(answer.streaming_content)
    got = next(pieces)
    host.close()
    with pytest.raises(shelf_file.FileAway):  # the server cuts the connection
        for piece in pieces:
            got += piece
    for rest in ("", "/file", "/file?format=bag", "/views?from=0&to=1", "/thumbnail"):
        refused = get(operator, recording, rest)
        assert (refused.status_code, refused.json()["code"]) == (503, "recording_away"), rest
        assert refused.json()["detail"].startswith("The computer that keeps this recording does not answer")
    host = BridgeHost(config)
    assert got + content(get(operator, recording, "/file", Range=f"bytes={len(got)}-")) == data
    host.close()


def test_a_host_that_is_silent_holds_a_thread_for_seconds_only(
    recording: Recording, operator: User, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shelf_file, "_silent_until_s", {})
    monkeypatch.setattr(shelf_file, "SLOW_S", 0.1)
    with socket.create_server((HOST, link_address(recording.robot).port or 0)):  # accepts, and says nothing
        began_s = time.monotonic()
        assert get(operator, recording).json()["code"] == "recording_away"
        asked_s = time.monotonic()
        assert asked_s - began_s < shelf_link.OPEN_S
        assert get(operator, recording).json()["code"] == "recording_away"
        assert time.monotonic() - asked_s < (asked_s - began_s) / 2


def test_a_file_that_is_gone_is_said(
    recording: Recording, operator: User, host: BridgeHost, elsewhere: Path
) -> None:
    shutil.move(elsewhere / recording.file, elsewhere / recording.file.replace(".mcap", ".part"))
    assert get(operator, recording).json()["code"] == "recording_away"
    Recording.objects.update(file="../../etc/passwd")
    assert get(operator, recording, "/file").json()["code"] == "recording_away"


def test_a_path_in_place_of_an_id_is_refused(
    recording: Recording, operator: User, host: BridgeHost, robot: Robot
) -> None:
    link = shelf_link.ShelfLink(robot.pk, link_address(robot))
    part, _ = link.read(ShelfRead(recording.pk, "file", 0, 10))
    assert part.size == recording.bytes
    for recording_id in ("../../etc/passwd", f"{recording.pk}/../../x", "*", ""):
        asked = wire.encode(
            {"t": "shelf_read", "recording": recording_id, "part": "file", "offset": 0, "size": 9}
        )
        link._socket.send(asked, text=True)
        with pytest.raises(ConnectionClosed):
            link._socket.recv(timeout=PATIENCE_S)
        link.close()
        link = shelf_link.ShelfLink(robot.pk, link_address(robot))
    with pytest.raises(ConnectionClosed):
        link.read(ShelfRead(recording.pk, "file", 0, wire.LARGEST_READ + 1))
    link.close()


def test_a_stranger_is_refused(recording: Recording, host: BridgeHost, robot: Robot) -> None:
    link = shelf_link.ShelfLink(robot.pk, link_address(robot))
    _, port = link._socket.socket.getpeername()
    stranger = structs.replace(link_address(robot), port=port, secret="x" * 40)
    with pytest.raises(Exception, match="401"):
        open_sync(stranger)
    link.close()


def test_the_directory_finds_whole_files_only(elsewhere: Path, recording: Recording) -> None:
    directory = RecordingDirectory(elsewhere, 0)
    assert directory.find(recording.pk).name == recording.file
    (elsewhere / recording.file).unlink()
    with pytest.raises(FileNotFoundError):
        directory.find(recording.pk)
