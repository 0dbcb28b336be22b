"""The pages of recordings: the list with its filters in the address, and the replay of one."""

from __future__ import annotations

import json
import re
from datetime import timedelta
from typing import Any

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from fleet.accounts.models import User
from fleet.audit.services import record
from robots.recordings.models import Recording
from robots.registry.models import Robot
from teleop.models import ControlSession
from tests.teleop.recordings.test_sight import BEGAN, at, session

pytestmark = pytest.mark.django_db


@pytest.fixture
def recording(robot: Robot, operator: User) -> Recording:
    """Ten minutes of the operator, with a stop in the sixth."""
    return Recording.objects.create(
        robot=robot,
        person=operator,
        kind="black_box",
        begins_at=BEGAN,
        ends_at=at(10),
        file="one.mcap",
        bytes=2_000_000,
        reason="bumped into the <b>cupboard</b>",
        events=[{"event": "stop", "at": at(5.5).timestamp(), "text": "Emergency stop", "by": "Olga"}],
        topics=[{"topic": "/odom", "type": "nav_msgs/Odometry", "messages": 100, "dropped": 0}],
    )


def page(person: User, path: str) -> Any:
    client = Client()
    client.force_login(person)
    return client.get(path)


def test_the_list_by_the_filters_in_its_address(recording: Recording, operator: User) -> None:
    whole = page(operator, "/recordings/").text
    assert f"/recordings/{recording.pk}/" in whole and "emergency stop" in whole and "0:10:00" in whole
    assert "&lt;b&gt;cupboard" in whole
    for query, count in (
        ("?q=cupboard&robot=tiago-1&kind=black_box&event=stop&topic=/odom&from=2026-11-02&to=2026-11-02", 1),
        ("?event=gate", 0),
        ("?to=2026-11-01", 0),
        ("?from=nonsense&to=0001-01-01&page=-3&kind=%00&q=%25", 0),
        ("?from=9999-12-31", 1),
    ):
        shown = page(operator, f"/recordings/{query}")
        assert shown.status_code == 200
        assert shown.text.count('data-kind="black_box"') == count, query


def test_others_see_nothing_of_it(recording: Recording, stranger: User, second_operator: User) -> None:
    assert str(recording.pk) not in page(stranger, "/recordings/").text
    assert page(stranger, f"/recordings/{recording.pk}/").status_code == 404
    assert page(second_operator, f"/recordings/{recording.pk}/").status_code == 404


def test_a_student_replays_their_own_part(
    recording: Recording, robot: Robot, operator: User, second_operator: User
) -> None:
    session(robot, operator, 0, 4)
    session(robot, second_operator, 5, 8)
    shown = page(operator, f"/recordings/{recording.pk}/").text
    replay = json.loads(re.findall(r'<script id="recording"[^>]*>(.*?)</script>', shown)[0])
    assert replay["sees"] == [[0.0, 240.0]] and replay["events"] == []
    assert "emergency stop" not in page(operator, "/recordings/").text.split('id="list"')[1]
    assert "0:04:00" in page(operator, "/recordings/").text and 'data-part="delete"' not in shown
    theirs = json.loads(
        re.findall(
            r'<script id="recording"[^>]*>(.*?)</script>',
            page(second_operator, f"/recordings/{recording.pk}/").text,
        )[0]
    )
    assert theirs["sees"] == [[300.0, 480.0]] and theirs["events"][0]["atS"] == 330.0


def test_a_page_says_what_is_not_kept_yet_and_what_is_left_out(recording: Recording, operator: User) -> None:
    address = f"/recordings/{recording.pk}/"
    rows = Recording.objects.filter(pk=recording.pk)
    for state, words in (
        ({}, "It is deleted when its time is over"),
        ({"kept_at": BEGAN}, "It will be kept: its computer is told"),
        ({"file_kept": True}, "It is kept until somebody deletes it."),
    ):
        rows.update(**state)
        assert words in page(operator, address).text
    assert "a recording has 300 at most" not in page(operator, address).text
    rows.update(left_out=12)
    assert "12 topics are not in it: a recording has 300 at most." in page(operator, address).text


def test_a_long_recording_has_links_between_its_parts(
    recording: Recording, operator: User, second_operator: User
) -> None:
    facts = {
        "robot": recording.robot,
        "kind": "by_hand",
        "begins_at": BEGAN,
        "ends_at": at(10),
        "file": "a.mcap",
    }
    later = Recording.objects.create(person=operator, continues=recording.pk, **facts)
    Recording.objects.create(person=second_operator, continues=recording.pk, **facts)  # not theirs
    for this, words, other in ((recording, "Later part", later), (later, "Earlier part", recording)):
        links = re.findall(r'href="([^"]*)">(\w+ part)', page(operator, f"/recordings/{this.pk}/").text)
        assert links == [(f"/recordings/{other.pk}/", words)]


def test_the_timeline_has_the_log_as_far_as_a_person_reads_it(
    robot: Robot, operator: User, second_operator: User, stranger: User, staff: User
) -> None:
    now = timezone.now()
    begins_at, ends_at = now - timedelta(seconds=60), now + timedelta(seconds=60)
    shown = Recording.objects.create(
        robot=robot, kind="booking", begins_at=begins_at, ends_at=ends_at, file="one.mcap"
    )
    mine, theirs = (
        ControlSession.objects.create(robot=robot, user=user, fence=fence, started_at=begins, ended_at=ends)
        for user, fence, begins, ends in (
            (operator, 1, now - timedelta(seconds=5), ends_at),
            (second_operator, 2, begins_at, now - timedelta(seconds=5)),
        )
    )
    shown.shares.create(person=stranger, made_at=now)
    facts = {"robot_id": robot.pk, "robot_name": robot.name}
    said = record("speech.start", actor=operator, session_id=mine.pk, text="Mind the cupboard", **facts)
    record("speech.end", of=said, session_id=mine.pk, outcome="succeeded", **facts)
    record("stop.press", actor=staff, **facts)
    record(
        "control.end", actor=second_operator, session_id=theirs.pk, **facts
    )  # late: in the part of another
    record("camera.start", actor=staff, **facts)
    record("stop.press", actor=staff)  # of no robot

    def timeline(person: User) -> list[tuple[str, str, str]]:
        text = page(person, f"/recordings/{shown.pk}/").text
        replay = json.loads(re.findall(r'<script id="recording"[^>]*>(.*?)</script>', text)[0])
        assert all(60 <= one["atS"] < 70 and one["isLogged"] for one in replay["events"])
        return [(one["event"], one["text"], one["by"]) for one in replay["events"]]

    speech, stop = ("speech", "Mind the cupboard · succeeded", "Olga Operator"), ("stop", "", "Sam Staff")
    assert timeline(operator) == [speech, stop]
    assert timeline(staff) == [speech, stop, ("control", "", "Olaf Operator")]
    assert timeline(stranger) == [stop]  # with whom it is shared sees all, but reads nobody's log
    assert timeline(second_operator) == []
    stopped = {"event": "stop", "at": timezone.now().timestamp(), "text": "Stopped.", "by": "Sam Staff"}
    Recording.objects.update(events=[stopped])
    text = page(operator, f"/recordings/{shown.pk}/").text
    assert text.count('"event": "stop"') == 1  # the press is the event


def test_a_long_list_needs_few_queries(
    recording: Recording, robot: Robot, operator: User, staff: User
) -> None:
    Recording.objects.bulk_create(
        Recording(
            robot=robot,
            person=operator,
            kind="by_hand",
            begins_at=BEGAN + timedelta(minutes=number),
            ends_at=BEGAN + timedelta(minutes=number + 1),
            file="a.mcap",
            topics=recording.topics,
        )
        for number in range(200)
    )
    for person, most in ((staff, 20), (operator, 20)):
        client = Client()
        client.force_login(person)
        with CaptureQueriesContext(connection) as made:
            assert client.get("/recordings/?page=3").status_code == 200
        assert len(made) <= most, [one["sql"][:90] for one in made]


def test_a_session_has_its_recordings_with_their_events(
    recording: Recording, robot: Robot, operator: User, second_operator: User
) -> None:
    mine, theirs = session(robot, operator, 0, 5), session(robot, second_operator, 5, 8)
    shown = page(operator, f"/sessions/{mine.pk}/").text
    assert f'/recordings/{recording.pk}/"' in shown and "?t=" not in shown
    shown = page(second_operator, f"/sessions/{theirs.pk}/").text
    assert f"/recordings/{recording.pk}/?t=320.0" in shown and "Replay: emergency stop" in shown
