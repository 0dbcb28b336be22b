"""An erased person in the files of recordings: from the erasure until the bridge's computer has cut them, and after."""

from __future__ import annotations

import io
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any
from uuid import uuid4

import msgspec
import pytest
from mcap.reader import make_reader
from msgspec import structs

from fleet.accounts.models import User
from fleet.accounts.services import account_erase
from robots.bridge.recorder.erasing.__main__ import cut_file
from robots.recordings.file_cuts import file_cut, file_cuts
from robots.recordings.models import Place, Recording
from robots.recordings.services import file_changes, recording_store, taken_of
from robots.registry.models import Robot
from robots.shared.records.record_sink import FileCut, KeptEvent, ShownControl, TakenRecording
from teleop.recordings import downloads
from tests.robots.recordings.samples import SECOND, sample
from tests.teleop.recordings.test_door import content, get
from tests.teleop.recordings.test_sight import BEGAN, session

pytestmark = pytest.mark.django_db
BEGAN_S = int(BEGAN.timestamp())


@pytest.fixture
def made(robot: Robot, tmp_path: Path, settings: Any) -> Callable[..., Recording]:
    """Make a recording of ten seconds, with its file, by a report of the bridge."""
    settings.FLEET_VAR = tmp_path

    def make(**given: Any) -> Recording:
        recording = uuid4()
        name = f"20261102T090000Z-black_box-{recording}.mcap"
        report = TakenRecording(
            recording,
            str(robot.pk),
            "black_box",
            BEGAN_S,
            BEGAN_S + 10.0,
            9,
            str(tmp_path),
            name,
            [],
            **given,
        )
        text = msgspec.json.encode(report).decode()
        (tmp_path / name).write_bytes(sample(begins_s=BEGAN_S, about=text).getvalue())
        return recording_store(robot.pk, report)

    return make


def stop(second: float, by: str) -> KeptEvent:
    return KeptEvent("stop", BEGAN_S + second, f"Stopped by {by}.", by)


def parts_of(data: bytes) -> tuple[list[int], TakenRecording]:
    """Return the seconds of a file, and what its metadata say."""
    reader = make_reader(io.BytesIO(data))
    seconds = {message.log_time // SECOND - BEGAN_S for *_, message in reader.iter_messages(["/odom"])}
    [about] = [note.metadata["taken"] for note in reader.iter_metadata() if note.name == "fleet"]
    return sorted(seconds), msgspec.json.decode(about, type=TakenRecording)


def cut_now() -> None:
    for cut in file_cuts():
        file_cut(structs.replace(cut, taken=cut_file(cut)))


def test_a_file_loses_the_erased_person_and_so_does_each_download(
    made: Any, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    name, number = operator.display_name, str(operator.pk)
    hers, his = session(robot, operator, -1, 4 / 60), session(robot, second_operator, 4 / 60, 8 / 60)
    recording = made(
        controls=[
            ShownControl(str(hers.pk), BEGAN_S, BEGAN_S + 4.0),
            ShownControl(str(his.pk), BEGAN_S + 4.0, BEGAN_S + 8.0),
        ],
        person=number,
        session=str(uuid4()),
        booking=str(uuid4()),
        reason="Her words",
        events=[stop(2, "Ben"), stop(6, name), stop(7, second_operator.display_name)],
    )
    assert name.encode() in content(get(staff, recording, "/file"))
    content(get(second_operator, recording, "/file"))
    assert list((downloads.settings.FLEET_VAR / "downloads").iterdir())
    account_erase(user=operator, actor=staff)
    # Before the cut: a part, which names nobody else; after it
    for named in ("", second_operator.display_name):
        seconds, about = parts_of(content(get(staff, recording, "/file")))
        assert seconds == [4, 5, 6, 7, 8, 9]
        assert (about.person, about.session, about.booking, about.reason) == ("", "", "", "")
        assert [event.by for event in about.events] == ["", named]
        cut_now()
    data = Path(recording.directory, recording.file).read_bytes()
    assert parts_of(data)[0] == [4, 5, 6, 7, 8, 9]
    assert not any(word.encode() in data for word in (name, number, "Her words", str(hers.pk)))
    assert str(his.pk).encode() in data
    recording.refresh_from_db()
    assert recording.stays is None and recording.bytes == len(data)
    assert recording.begins_at == BEGAN + timedelta(seconds=4)
    assert recording.ends_at == BEGAN + timedelta(seconds=9, microseconds=900_000)
    assert {topic["topic"]: topic["messages"] for topic in recording.topics}["/odom"] == 59
    assert file_cuts() == []
    seconds, about = parts_of(content(get(second_operator, recording, "/file")))
    assert seconds == [4, 5, 6, 7, 8] and (about.person, about.controls) == ("", None)


def test_made_downloads_go_with_the_person(
    made: Any, robot: Robot, operator: User, staff: User, django_capture_on_commit_callbacks: Any
) -> None:
    recording = made(person=str(operator.pk))
    session(robot, operator, 0, 1)
    content(get(staff, recording, "/file?format=bag"))
    folder = downloads.settings.FLEET_VAR / "downloads"
    assert [path.suffix for path in folder.iterdir()] == [".bag"]
    with django_capture_on_commit_callbacks(execute=True):
        account_erase(user=operator, actor=staff)
    assert list(folder.iterdir()) == []


def test_a_recording_that_only_names_the_person_loses_the_name(
    made: Any, robot: Robot, operator: User, staff: User
) -> None:
    name = operator.display_name
    recording = made(person=str(staff.pk), events=[stop(5, name)], reason=f"{name} asked for it")
    account_erase(user=operator, actor=staff)
    assert name.encode() not in content(get(staff, recording, "/file"))  # the file still has it
    cut_now()
    seconds, about = parts_of(Path(recording.directory, recording.file).read_bytes())
    assert seconds == list(range(10)) and about.person == str(staff.pk)
    assert (about.reason, [(event.by, event.text) for event in about.events]) == ("", [("", "")])


def test_a_late_report_names_nobody_who_was_erased(
    made: Any, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    name, number = operator.display_name, str(operator.pk)
    session(robot, operator, 0, 3 / 60)
    session(robot, second_operator, 3 / 60, 1)
    account_erase(user=operator, actor=staff)
    recording = made(person=number, reason="Her words", events=[stop(1, "Ben"), stop(5, name)])
    recording.refresh_from_db()
    assert (recording.person, recording.reason) == (None, "")
    assert [(event["at"] - BEGAN_S, event["by"], event["text"]) for event in recording.events] == [
        (5, "", "")
    ]
    cut_now()
    data = Path(recording.directory, recording.file).read_bytes()
    assert parts_of(data)[0] == [3, 4, 5, 6, 7, 8, 9]
    assert not any(word.encode() in data for word in (name, number, "Her words"))


def test_a_late_report_of_what_shows_nobody_else_is_deleted(
    made: Any, robot: Robot, operator: User, staff: User
) -> None:
    session(robot, operator, 0, 3 / 60)
    account_erase(user=operator, actor=staff)
    recording = made(person=str(operator.pk))
    recording.refresh_from_db()
    assert (recording.place, recording.person, recording.stays) == (Place.GONE, None, None)
    assert file_changes() == [(recording.pk, "remove")]


def test_a_file_that_must_lose_more_is_cut_again(
    made: Any, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    session(robot, operator, 0, 3 / 60)
    session(robot, second_operator, 7 / 60, 1)
    recording = made(person=str(staff.pk))
    account_erase(user=operator, actor=staff)
    [first] = file_cuts()
    account_erase(user=second_operator, actor=staff)
    file_cut(structs.replace(first, taken=cut_file(first)))
    [second] = file_cuts()
    assert second.stays != first.stays
    cut_now()
    assert file_cuts() == []
    assert parts_of(Path(recording.directory, recording.file).read_bytes())[0] == [3, 4, 5, 6]


def test_a_cut_after_the_deletion_removes_the_file_again(made: Any, robot: Robot, staff: User) -> None:
    recording = made(person=str(staff.pk))
    Recording.objects.update(place=Place.GONE, file="")
    file_cut(FileCut(taken_of(recording), [(0, 2**63 - 1)]))
    assert file_changes() == [(recording.pk, "remove")]


def test_ones_own_part_is_ones_own_time_and_names_nobody_else(
    made: Any, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    mine = operator.display_name
    session(robot, second_operator, -1, 3 / 60)
    session(robot, operator, 3 / 60, 6 / 60)
    session(robot, second_operator, 6 / 60, 1)
    recording = made(
        person=str(second_operator.pk),
        session=str(uuid4()),
        booking=str(uuid4()),
        reason="His words",
        events=[stop(1, mine), stop(4, mine), stop(5, second_operator.display_name)],
    )
    data = content(get(operator, recording, "/file"))
    seconds, about = parts_of(data)
    assert seconds == [3, 4, 5, 6]  # its first moment of the last one is that of the end of control
    assert (about.begins, about.ends) == (BEGAN_S + 3, BEGAN_S + 6)
    assert (about.person, about.session, about.booking, about.reason) == ("", "", "", "")
    assert [(event.at - BEGAN_S, event.by, event.text) for event in about.events] == [
        (4, mine, f"Stopped by {mine}."),
        (5, "", ""),
    ]
    assert str(second_operator.pk).encode() not in data
    listed = get(operator, recording).json()["recording"]
    assert [event["at"] - BEGAN_S for event in listed["events"]] == [4, 5]
