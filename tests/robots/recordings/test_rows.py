"""Rows of recordings: stored once, however often the recorder reports its file."""

from __future__ import annotations

from uuid import UUID, uuid4

import pytest
from django.db import connection
from django.test.utils import CaptureQueriesContext
from django.utils import timezone
from msgspec import structs

from fleet.accounts.models import User
from robots.recordings import services
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
    assert row.file == "" and sink.recording_changes(None) == []
    sink.keep_recording(report)  # a late report of the same file
    assert Recording.objects.get().place == Place.GONE


def test_the_bridge_learns_what_people_decided_until_it_is_done(robot: Robot) -> None:
    sink, report = AuditSink(robot.pk, robot.name), taken(robot)
    sink.keep_recording(report)
    rows, name = Recording.objects.filter(pk=report.recording), str(report.recording)
    assert sink.recording_changes(None) == []
    for change, given in (
        ("keep", {"kept_at": timezone.now()}),
        ("let_go", {"kept_at": None}),
        ("remove", {"place": Place.GONE}),
    ):
        rows.update(**given)
        assert sink.recording_changes(None) == sink.recording_changes(None) == [(name, change)]
        sink.recording_changed(report.recording, change)
        assert sink.recording_changes(None) == []
    assert rows.get().file == ""


def test_each_bridge_learns_the_changes_of_all_robots_in_pages(
    robot: Robot, other_robot: Robot, monkeypatch
) -> None:
    monkeypatch.setattr(services, "MOST_CHANGES", 2)
    sink, reports = AuditSink(robot.pk, robot.name), [taken(other_robot) for _ in range(3)]
    for report in reports:
        AuditSink(other_robot.pk, other_robot.name).keep_recording(report)
    Recording.objects.update(place=Place.GONE)
    first = sink.recording_changes(None)
    second = sink.recording_changes(UUID(first[-1][0]))
    assert [name for name, _ in first + second] == sorted(str(report.recording) for report in reports)
    assert sink.recording_changes(UUID(second[-1][0])) == []


@pytest.mark.skipif(connection.vendor != "sqlite", reason="the plan in SQLite's words")
def test_the_search_for_changes_reads_no_row(robot: Robot) -> None:
    with CaptureQueriesContext(connection) as queries:
        services.file_changes(uuid4())
    with connection.cursor() as cursor:
        cursor.execute(f"EXPLAIN QUERY PLAN {queries[0]['sql']}")
        (step,) = cursor.fetchall()
    assert "USING COVERING INDEX recordings_to_change" in step[-1]
