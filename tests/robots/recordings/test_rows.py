"""Rows of recordings: stored once, however often the recorder reports its file."""

from __future__ import annotations

from uuid import uuid4

import pytest
from django.utils import timezone
from msgspec import structs

from fleet.accounts.models import User
from robots.recordings.models import Place, Recording
from robots.records.bridge_records import AuditSink
from robots.registry.models import Robot
from robots.shared.records.record_sink import KeptEvent, RecordedTopic, TakenRecording

pytestmark = pytest.mark.django_db(transaction=True)  # the sink opens connections of its own


def taken(robot: Robot, **given: object) -> TakenRecording:
    return TakenRecording(
        uuid4(),
        str(robot.pk),
        "black_box",
        1000.0,
        1045.0,
        2_000_000,
        "/var/recordings",
        "one.mcap",
        [RecordedTopic("/scan", "sensor_msgs/LaserScan", 600, 3)],
        [KeptEvent("stop", 1030.0, "Emergency stop", "Olga")],
        **given,
    )


def test_a_report_that_is_repeated_makes_one_row(robot: Robot, operator: User) -> None:
    sink, report = AuditSink(robot.pk, robot.name), taken(robot, person=str(operator.pk))
    sink.keep_recording(report)
    sink.keep_recording(structs.replace(report, bytes=1))
    row = Recording.objects.get()
    assert (row.pk, row.robot, row.person, row.bytes) == (report.recording, robot, operator, 2_000_000)
    assert row.topics == [{"topic": "/scan", "type": "sensor_msgs/LaserScan", "messages": 600, "dropped": 3}]
    assert [event["event"] for event in row.events] == ["stop"] and row.session is None


def test_a_person_who_is_gone_leaves_a_recording_of_nobody(robot: Robot) -> None:
    AuditSink(robot.pk, robot.name).keep_recording(taken(robot, person=str(uuid4()), session="no id"))
    assert Recording.objects.get().person is None


def test_a_removed_file_leaves_its_row(robot: Robot) -> None:
    sink, report = AuditSink(robot.pk, robot.name), taken(robot)
    sink.keep_recording(report)
    sink.drop_recording(report.recording)
    row = Recording.objects.get()
    assert row.place == Place.GONE and row.deleted_at is not None
    assert row.file == "" and sink.recording_changes() == []
    sink.keep_recording(report)  # a late report of the same file
    assert Recording.objects.get().place == Place.GONE


def test_the_bridge_learns_what_people_decided_until_it_is_done(robot: Robot) -> None:
    sink, report = AuditSink(robot.pk, robot.name), taken(robot)
    sink.keep_recording(report)
    rows, name = Recording.objects.filter(pk=report.recording), str(report.recording)
    assert sink.recording_changes() == []
    for change, given in (
        ("keep", {"kept_at": timezone.now()}),
        ("let_go", {"kept_at": None}),
        ("remove", {"place": Place.GONE}),
    ):
        rows.update(**given)
        assert sink.recording_changes() == sink.recording_changes() == [(name, change)]
        sink.recording_changed(report.recording, change)
        assert sink.recording_changes() == []
    assert rows.get().file == ""
