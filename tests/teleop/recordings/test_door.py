"""Recordings through the API: what each person gets of a file on disk."""

from __future__ import annotations

import io
import json
import os
import struct
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from uuid import uuid4

import pytest
from django.http import HttpResponseBase
from django.test import Client
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.rosbag1 import Reader

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.recordings.models import Recording
from robots.registry.models import Robot
from teleop.recordings import downloads
from tests.robots.recordings.samples import sample
from tests.teleop.recordings.test_sight import BEGAN, session

pytestmark = pytest.mark.django_db


@pytest.fixture
def recording(robot: Robot, operator: User, tmp_path: Path, settings: Any) -> Recording:
    """Ten seconds of the operator."""
    settings.FLEET_VAR = tmp_path
    (tmp_path / "one.mcap").write_bytes(sample(begins_s=int(BEGAN.timestamp())).getvalue())
    session(robot, operator, -1, 0.05)  # until its third second
    return Recording.objects.create(
        robot=robot,
        person=operator,
        kind="black_box",
        begins_at=BEGAN,
        ends_at=BEGAN + timedelta(seconds=10),
        directory=str(tmp_path),
        file="one.mcap",
        bytes=1000,
        events=[{"event": "stop", "at": BEGAN.timestamp() + 5, "text": "Emergency stop", "by": "Olga"}],
        topics=[{"topic": "/odom", "type": "a_msgs/Odom", "messages": 100, "dropped": 0}],
    )


def get(person: User, recording: Recording, rest: str = "", **headers: str) -> HttpResponseBase:
    client = Client()
    client.force_login(person)
    return client.get(f"/api/v1/recordings/{recording.pk}{rest}", headers=headers)


def content(answer: Any) -> bytes:
    return b"".join(answer.streaming_content) if answer.streaming else answer.content


def test_an_owner_replays_all(recording: Recording, operator: User) -> None:
    detail = get(operator, recording).json()
    assert (
        detail["whole"] and detail["contents"]["parts"] == [[0.0, 10.0]] and detail["contents"]["has_views"]
    )
    [odom] = [one for one in detail["contents"]["channels"] if one["topic"] == "/odom"]
    assert odom["messages"] == 100 and "at.z" in odom["fields"]
    views = get(operator, recording, "/views?from=2&to=4").json()
    assert [at for at, *_ in views["views"]] == [round(2 + tick / 10, 1) for tick in range(21)]
    assert views["views"][0][1] == {"state": {"speed": 20}}
    series = get(operator, recording, "/series?topic=/odom&field=speeds[1]&from=0&to=1").json()
    assert series["values"] == [-float(tick) for tick in range(11)]


def test_a_student_gets_the_time_of_their_session_and_no_more(
    recording: Recording, robot: Robot, operator: User, second_operator: User
) -> None:
    session(robot, second_operator, 0.05, 5)
    assert get(operator, recording).json()["contents"]["parts"] == [[0.0, 3.0]]
    views = get(operator, recording, "/views?from=2&to=9").json()
    assert views["views"][-1][0] <= 3.0 and views["until_s"] == 3.0
    for rest in (
        "/views?from=4&to=5",
        "/series?topic=/odom&field=at.x&from=4&to=5",
        "/picture?topic=/camera&at=4",
    ):
        refused = get(operator, recording, rest)
        assert refused.json()["code"] == "not_your_part", rest
    file = io.BytesIO(content(get(operator, recording, "/file")))
    times = [
        message.log_time / 1e9 - BEGAN.timestamp() for _, _, message in make_reader(file).iter_messages()
    ]
    assert max(times) <= 3.001 and len(times) > 60
    theirs = io.BytesIO(content(get(second_operator, recording, "/file?from=0&to=3.5")))
    times = [
        message.log_time / 1e9 - BEGAN.timestamp() for _, _, message in make_reader(theirs).iter_messages()
    ]
    assert min(times) >= 2.999 and max(times) <= 3.501


def test_whose_recording_it_is_and_what_others_did_stays_theirs(
    recording: Recording, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    session(robot, second_operator, 0.05, 0.07)  # before the stop
    Recording.objects.update(reason="bumped into the cupboard", session=uuid4(), events=[*recording.events])
    hidden = ("cupboard", "Emergency stop", "Olga", str(operator.pk), operator.display_name)

    def told(person: User) -> list[str]:
        file = io.BytesIO(content(get(person, recording, "/file?format=mcap")))
        client = Client()
        client.force_login(person)
        return [
            str(list(make_reader(file).iter_metadata())),
            json.dumps(get(person, recording).json()),
            client.get("/api/v1/recordings").text,
            client.get("/recordings/").text.split('id="list"')[1].split("</ul>")[0],
            client.get(f"/recordings/{recording.pk}/").text.split("<main")[1].split("</main>")[0],
        ]

    for where, text in enumerate(told(second_operator)):
        assert str(recording.pk) in text and not any(words in text for words in hidden), where
    for where, text in enumerate(told(operator)):  # their own part ends before the stop, too
        assert "cupboard" in text and "Emergency stop" not in text, where
    assert all("cupboard" in text for text in told(staff)[1:])
    client = Client()
    client.force_login(second_operator)
    for query, count in (("", 1), ("?q=tiago", 1), ("?q=cupboard", 0), ("?q=Olga", 0), ("?event=stop", 0)):
        assert len(client.get(f"/api/v1/recordings{query}").json()["recordings"]) == count, query
    assert client.get(f"/api/v1/recordings?person={operator.username}").json()["recordings"] == []


def test_a_topic_that_changes_its_type_is_plotted(
    recording: Recording, operator: User, tmp_path: Path
) -> None:
    with (tmp_path / "one.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros1", library="test")
        for second, (kind, text, data) in enumerate(
            (
                ("a/Old", "int32 wide\nfloat64 x", struct.pack("<id", 1, 2.5)),
                ("a/New", "float64 x", struct.pack("<d", 3.5)),
                ("a/Bad", "nothing that is known", b"12345678"),
            )
        ):
            channel = writer.register_channel(
                "/odom", "ros1", writer.register_schema(kind, "ros1msg", text.encode())
            )
            at_ns = (int(BEGAN.timestamp()) + second) * 1_000_000_000
            writer.add_message(channel, at_ns, data, at_ns, second)
        writer.finish()  # type: ignore[no-untyped-call]
    series = get(operator, recording, "/series?topic=/odom&field=x&from=0&to=9").json()
    assert series == {"at_s": [0.0, 1.0, 2.0], "values": [2.5, 3.5, None]}
    bad = get(operator, recording, "/series?topic=/odom&field=x&from=1.5&to=9").json()
    assert bad["code"] == "type_unknown"


def test_only_pictures_are_pictures(recording: Recording, operator: User) -> None:
    for topic in ("/odom", "/map", "/fleet/view", "/none"):
        assert get(operator, recording, f"/picture?topic={topic}&at=4").json()["code"] == "no_picture", topic


def test_a_part_can_be_read_from_its_rounded_begin(
    recording: Recording, robot: Robot, second_operator: User
) -> None:
    session(robot, second_operator, 4.0004 / 60, 1)  # s: told as 4.0, which is before it
    [[begin, _end]] = get(second_operator, recording).json()["contents"]["parts"]
    views = get(second_operator, recording, f"/views?from={begin}&to=5").json()["views"]
    assert begin == 4.0 and views[0][0] == 4.1


def test_a_download_is_continued_and_on_record_once(
    recording: Recording, operator: User, tmp_path: Path
) -> None:
    whole = (tmp_path / "one.mcap").read_bytes()
    first = get(operator, recording, "/file", Range="bytes=0-99")
    assert first.status_code == 206 and first["Content-Range"] == f"bytes 0-99/{len(whole)}"
    got = content(first)
    while len(got) < len(whole):  # a hundred breaks and more
        got += content(get(operator, recording, "/file", Range=f"bytes={len(got)}-{len(got) + 99}"))
    assert got == whole
    assert get(operator, recording, "/file", Range=f"bytes={len(whole)}-").status_code == 416
    assert content(get(operator, recording, "/file", **{"If-Range": '"old"', "Range": "bytes=5-"})) == whole
    assert Record.objects.filter(kind="recording.download").count() == 2


def test_a_download_without_its_first_byte_is_on_record(recording: Recording, operator: User) -> None:
    for beginning in ("1", "100", "200"):
        assert content(get(operator, recording, "/file", Range=f"bytes={beginning}-"))
    content(get(operator, recording, "/file?topics=/odom", Range="bytes=1-"))
    get(operator, recording, "/file", Range="bytes=999999-")  # nothing is sent
    assert Record.objects.filter(kind="recording.download").count() == 2


def test_a_browser_continues_a_part(recording: Recording, operator: User) -> None:
    first = get(operator, recording, "/file?topics=/odom", Range="bytes=0-99")
    whole = content(get(operator, recording, "/file?topics=/odom"))
    rest = get(
        operator, recording, "/file?topics=/odom", **{"If-Range": first["ETag"], "Range": "bytes=100-"}
    )
    assert rest.status_code == 206 and content(first) + content(rest) == whole


def test_downloads_leave_room_for_recordings(
    recording: Recording, operator: User, tmp_path: Path, settings: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = [10**12]
    monkeypatch.setattr(downloads.shutil, "disk_usage", lambda _folder: SimpleNamespace(free=free[0]))
    whole = (
        (tmp_path / "one.mcap").stat().st_size
    )  # its messages are mostly zeros: as a bag they take twice as much
    bag = len(content(get(operator, recording, "/file?format=bag")))
    (tmp_path / "downloads").joinpath(*os.listdir(tmp_path / "downloads")).unlink()
    settings.FLEET_RECORDINGS_FREE_BYTES = 5 * 10**9
    least = settings.FLEET_RECORDINGS_FREE_BYTES + downloads.RESERVE
    assert bag > 2 * whole
    free[0] = least + 3 * bag // 4
    assert get(operator, recording, "/file?format=bag").json()["code"] == "disk_full"
    assert content(get(operator, recording, "/file?topics=/odom"))
    free[0] = least + 2 * bag
    assert len(content(get(operator, recording, "/file?format=bag"))) == bag


def test_downloads_that_nobody_uses_give_way_to_new_ones(
    recording: Recording, operator: User, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content(get(operator, recording, "/file?format=bag"))
    [first] = (tmp_path / "downloads").iterdir()
    monkeypatch.setattr(downloads, "MOST_BYTES", 2 * first.stat().st_size)
    assert get(operator, recording, "/file?format=bag&from=0&to=9.99").json()["code"] == "disk_full"  # in use
    os.utime(first, (0, 0))
    assert content(get(operator, recording, "/file?format=bag&from=0&to=9.99"))
    assert not first.exists()


def test_a_bag_of_chosen_topics(recording: Recording, operator: User, tmp_path: Path) -> None:
    answer = get(operator, recording, "/file?format=bag&topics=/odom,/fleet/view&from=1&to=2")
    assert answer["Content-Disposition"] == 'attachment; filename="tiago-1-20261102T090000Z-part.bag"'
    (tmp_path / "got.bag").write_bytes(content(answer))
    with Reader(tmp_path / "got.bag") as bag:
        assert {one.topic for one in bag.connections} == {"/odom", "/fleet/view"} and bag.message_count == 22
    nothing = get(operator, recording, "/file?topics=/none")
    assert nothing.json()["code"] == "nothing_in_it"


def test_a_list_by_its_filters(recording: Recording, operator: User, stranger: User) -> None:
    client = Client()
    client.force_login(operator)
    for query, count in (
        ("", 1),
        ("?event=stop&topic=/odom&kind=black_box&q=olga", 1),
        ("?event=gate", 0),
        ("?topic=/odo", 0),
        ("?from=2026-11-02T09:00:05Z&to=2026-11-02T10:00:00Z", 1),
        ("?from=2026-11-02T09:00:10Z", 0),
        ("?q=%25", 0),
    ):
        assert len(client.get(f"/api/v1/recordings{query}").json()["recordings"]) == count, query
    client.force_login(stranger)
    assert client.get("/api/v1/recordings").json()["recordings"] == []


def test_a_file_that_is_gone_or_broken_is_said(recording: Recording, operator: User, tmp_path: Path) -> None:
    (tmp_path / "one.mcap").write_bytes(b"rubbish")
    assert get(operator, recording).json()["code"] == "recording_unreadable"
    (tmp_path / "one.mcap").unlink()
    for rest in ("", "/file", "/file?format=bag", "/views?from=0&to=1"):
        answer = get(operator, recording, rest)
        assert answer.status_code == 503 and answer.json()["code"] == "recording_away", rest
    Recording.objects.update(file="../../etc/passwd")
    assert get(operator, recording, "/file").json()["code"] == "recording_away"
