"""Files lose people who were erased: names in the chain, sessions, metadata. Kills do no harm."""

from __future__ import annotations

import asyncio
import fcntl
import json
import signal
import subprocess
import sys
from pathlib import Path
from uuid import UUID, uuid4

import msgspec
import pytest
from mcap.reader import make_reader

from robots.bridge.recorder.erasing.__main__ import cut_file
from robots.bridge.recorder.erasing.file_cuts import FIRST_S, FileCuts
from robots.bridge.recorder.erasing.nameless import Nameless
from robots.bridge.recorder.files.finished_files import read
from robots.bridge.recorder.files.mcap_file import McapFile
from robots.bridge.recorder.files.rounds import EVERY_S
from robots.bridge.recorder.recorder_messages import ChainEvent
from robots.shared import wire
from robots.shared.configuration.bridge_config import RecordingPlace
from robots.shared.records.record_sink import FileCut, TakenRecording
from robots.shared.sentences import say
from tests.robots.recordings.samples import SECOND, sample

END = 2**63 - 1
NAME = "20261102T090000Z-black_box-{}.mcap"


def test_names_leave_the_chain_also_in_later_texts() -> None:
    nameless = Nameless()
    stopped = say("Stopped by {by}.", by="Olga")
    verdict = wire.Verdict("stopped", stopped, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    view = {
        "holder": "Ben Brown",
        "watchers": ["Olga", "Jo"],
        "stop": {"state": "stopped", "by": "Olga", "reason": "Ben Brown drives"},
        "verdict": json.loads(wire.encode(verdict)),
        "motion": None,
        "speech": {"who": "Jo", "text": "I am not Johanna"},
        "laser_cm": [1, 2],
    }
    found = json.loads(nameless(json.dumps(view).encode()))
    assert found == {
        "holder": "…",
        "watchers": ["…", "…"],
        "stop": {"state": "stopped", "by": "…", "reason": "… drives"},
        "verdict": view["verdict"] | {"text": "Stopped by ….", "said": {"text": [stopped.key, {"by": "…"}]}},
        "motion": None,
        "speech": {"who": "…", "text": "I am not Johanna"},
        "laser_cm": [1, 2],
    }
    later = ChainEvent("refused", "say: The robot speaks, requested by Olga: wait.", code="speaking")
    assert b"requested by \xe2\x80\xa6: wait" in nameless(msgspec.json.encode(later))
    taken = ChainEvent("refused", "Control is with Eva now.", code="old_fence", figures={"holder": "Eva"})
    assert b"Eva" not in nameless(msgspec.json.encode(taken))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file of ten seconds whose chain and metadata name Olga, with a small picture."""
    recording = uuid4()
    path = tmp_path / NAME.format(recording)
    path.write_bytes(sample(holder="Olga", about=msgspec.json.encode(taken(path)).decode()).getvalue())
    path.with_suffix(".jpg").write_bytes(b"her picture")
    return path


def taken(path: Path, person: str = "olga-id") -> TakenRecording:
    number = UUID(path.stem.split("black_box-")[1])
    return TakenRecording(
        number, "r", "black_box", 0.0, 10.0, 9, str(path.parent), path.name, [], person=person
    )


def seconds_of(path: Path, topic: str) -> list[int]:
    with path.open("rb") as stream:
        found = [message.log_time // SECOND for _, _, message in make_reader(stream).iter_messages([topic])]
    return sorted(set(found))


def test_a_file_loses_a_session_and_names(path: Path) -> None:
    cut = FileCut(taken(path, person=""), [(0, 2 * SECOND), (5 * SECOND + 1, END)])
    found = cut_file(cut)
    assert seconds_of(path, "/odom") == [0, 1, 5, 6, 7, 8, 9] and found.bytes == path.stat().st_size
    assert (found.begins, found.ends) == (0.0, 9.9)
    assert {one.topic: one.messages for one in found.topics}["/odom"] == 20 + 49
    with path.open("rb") as stream:
        reader = make_reader(stream)
        views = [bytes(message.data) for *_, message in reader.iter_messages(["/fleet/view"])]
    assert len(views) == 69 and not any(b"Olga" in view for view in views)
    assert b"olga-id" not in path.read_bytes()
    about = read(path)
    assert about is not None and about.person == ""
    assert not path.with_suffix(".jpg").exists() and not found.thumbnail
    inode = path.stat().st_ino
    assert (
        cut_file(cut) == found and path.stat().st_ino == inode
    )  # another bridge of this computer finds it done
    assert list(path.parent.iterdir()) == [path]


def test_what_was_latched_before_comes_with_what_stays(path: Path) -> None:
    cut_file(FileCut(taken(path), [(4 * SECOND, END)]))
    assert seconds_of(path, "/map") == [4] and seconds_of(path, "/camera") == [4, 5, 6, 7, 8, 9]
    assert path.read_bytes().count(b"olga-id") == 1  # in `fleet`, which a part has not


def test_what_was_latched_comes_although_its_chunk_is_late(tmp_path: Path) -> None:
    path = tmp_path / NAME.format(uuid4())
    with path.open("wb", buffering=0) as stream:
        file = McapFile(stream, "ros1")
        channels = {
            topic: file.channel(topic, "ros1", file.schema("a/B", "ros1msg", b""), {"latching": latching})
            for topic, latching in (("/map", "1"), ("/odom", "0"))
        }
        for topic, second in (("/map", 1), ("/odom", 6), ("/map", 4), ("/odom", 2)):
            file.add(channels[topic], second, second * SECOND, b"")
            file.flush()
        file.finish()
    cut_file(FileCut(taken(path), [(5 * SECOND, 5 * SECOND + 1), (6 * SECOND, END)]))
    with path.open("rb") as stream:
        found = list(make_reader(stream).iter_messages())
    maps = [message.sequence for _, channel, message in found if channel.topic == "/map"]
    assert maps == [1, 4] and {message.log_time for *_, message in found} == {6 * SECOND}


def test_a_file_of_which_nothing_stays_is_removed(path: Path) -> None:
    assert cut_file(FileCut(taken(path), [(20 * SECOND, END)])).bytes == 0
    assert list(path.parent.iterdir()) == []


def test_without_a_session_the_small_picture_stays(path: Path) -> None:
    assert seconds_of(path, "/odom") == list(range(10))
    cut_file(FileCut(taken(path, person=""), [(0, END)]))
    assert path.with_suffix(".jpg").exists() and seconds_of(path, "/odom") == list(range(10))


DIES = """
import os, signal
from robots.bridge.recorder.erasing import __main__ as erasing
erasing.{} = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
erasing.main()
"""


@pytest.mark.parametrize("dies_at", ("rewrite", "os.fsync", "make_picture", "sync_folder"))
def test_a_killed_cut_leaves_a_whole_file_and_is_repeated(path: Path, dies_at: str) -> None:
    cut = FileCut(taken(path, person=""), [(0, 7 * SECOND)])
    command = [sys.executable, "-c", DIES.format(dies_at)]
    killed = subprocess.run(command, input=msgspec.json.encode(cut), check=False)
    assert killed.returncode == -signal.SIGKILL
    assert seconds_of(path, "/odom") == list(range(7 if dies_at == "sync_folder" else 10))
    assert cut_file(cut).ends == 6.9
    assert seconds_of(path, "/odom") == list(range(7)) and list(path.parent.iterdir()) == [path]


def test_two_processes_do_not_write_the_same_file(path: Path) -> None:
    with path.with_suffix(".draft").open("wb") as draft:
        fcntl.flock(draft, fcntl.LOCK_EX)
        with pytest.raises(BlockingIOError):
            cut_file(FileCut(taken(path), [(0, END)]))
    for name in ("../one.mcap", "one.mcap"):
        with pytest.raises(FileNotFoundError):
            cut_file(FileCut(msgspec.structs.replace(taken(path), name=name), [(0, END)]))


class Config:
    def __init__(self, directory: Path) -> None:
        self.recordings = RecordingPlace(str(directory), 10**9, 0)


class Records:
    """The records of a bridge whose database wants these cuts until they are done."""

    def __init__(self, *wanted: FileCut) -> None:
        self.wanted = list(wanted)
        self.done: list[FileCut] = []

    def recording_cuts(self, after: UUID | None, found) -> None:
        found([cut for cut in self.wanted if after is None or cut.taken.recording > after])

    def recording_cut(self, done: FileCut) -> None:
        self.done.append(done)


async def test_files_here_are_cut_although_one_cannot_be(path: Path) -> None:
    elsewhere, broken = (path.with_name(NAME.format(UUID(int=number))) for number in (1, 2))
    broken.write_bytes(b"no recording")
    wanted = [FileCut(taken(one), [(3 * SECOND, END)]) for one in (elsewhere, broken, path)]
    records = Records(*wanted)
    cuts = FileCuts(Config(path.parent), records)
    cuts.tick(0.0)
    cuts.tick(FIRST_S)
    while not records.done:  # noqa: ASYNC110
        await asyncio.sleep(0.005)
    [done] = records.done
    assert done.taken.begins == 3.0 and done.stays == [(3 * SECOND, END)]
    assert seconds_of(path, "/odom")[0] == 3
    records.wanted = []
    cuts.tick(FIRST_S + EVERY_S)
    cuts.close()
