"""Recordings as a person's own data, and when the person is erased."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from django.urls import reverse

from fleet.accounts.models import User
from fleet.accounts.services import account_erase
from fleet.base import zones
from robots.recordings.models import Place, Recording
from robots.registry.models import Robot
from teleop.models import RecordingShare
from teleop.recordings.selectors import Part, recordings_about, sight_of
from teleop.reports.own_data import _whole_data, own_recordings
from tests.teleop.recordings.test_sight import BEGAN, at, recorded, session

pytestmark = pytest.mark.django_db
__all__ = ["recorded"]


def stop(minute: float, by: str) -> dict[str, Any]:
    return {"event": "stop", "at": at(minute).timestamp(), "text": f"Stopped by {by}", "by": by}


def test_own_data_ends_where_somebody_elses_session_begins(
    recorded: Any, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    both, mine = recorded(person=second_operator, reason="His words"), recorded(40, 50, person=operator)
    session(robot, second_operator, 0, 10)
    session(robot, operator, 10, 30)
    session(robot, operator, 42, 44)
    page = own_recordings(operator, None)
    assert [(one.recording, one.part) for one in page.shown] == [
        (mine, Part(at(40), at(50))),
        (both, Part(at(10), at(30))),
    ]
    assert page.shown[1].address.endswith(f"{both.pk}/file?from=600.0&to=1800.0")
    assert own_recordings(operator, None, most=1).older == mine.begins_at
    assert own_recordings(staff, None).shown == []  # staff see all, but none of it is about them


def test_the_page_and_the_export_have_them(
    recorded: Any, robot: Robot, operator: User, signed_in: Callable[..., Any]
) -> None:
    recording = recorded(person=operator, topics=[{"topic": "/odom"}])
    session(robot, operator, 0, 30)
    page = signed_in(operator).get(reverse("your-data")).content.decode()
    assert f"/recordings/{recording.pk}/file?from=0.0" in page
    [(text, count)] = list(_whole_data(operator, zones.viewers()))[-1:]
    line = json.loads(text)
    assert count == 1 and line["recording"] == str(recording.pk)
    assert line["topics"] == ["/odom"] and line["until"] == at(30).isoformat()


def test_an_erased_persons_own_recordings_are_deleted(
    recorded: Any, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    session(robot, operator, 0, 30)
    mine = recorded(person=operator, kept_at=BEGAN, reason="Olga’s", events=[stop(1, "Olga Operator")])
    nobodys = recorded(5, 20)  # shows only this person
    RecordingShare.objects.create(recording=recorded(60, 70), person=operator, made_at=BEGAN)
    account_erase(user=operator, actor=staff)
    for recording in (mine, nobodys):
        recording.refresh_from_db()
        assert (recording.place, recording.person, recording.reason) == (Place.GONE, None, "")
    assert not RecordingShare.objects.exists() and not recordings_about(operator).exists()


def test_nobody_sees_the_session_of_an_erased_person_any_more(
    recorded: Any, robot: Robot, operator: User, second_operator: User, staff: User
) -> None:
    session(robot, operator, 0, 10)
    session(robot, second_operator, 10, 20)
    name = operator.display_name
    recording = recorded(person=operator, events=[stop(5, "Ben"), stop(15, name), stop(16, "Ben")])
    watched = recorded(40, 50, person=staff, events=[stop(41, name)])
    account_erase(user=operator, actor=staff)
    sight = sight_of(staff, Recording.objects.get(pk=recording.pk))
    assert sight is not None and not sight.whole
    assert sight.parts == [Part(at(10), at(30))] and sight.may_change
    assert sight.recording.person is None
    assert [event["by"] for event in sight.recording.events] == ["", "Ben"]
    other = sight_of(second_operator, sight.recording)
    assert other is not None and other.parts == [Part(at(10), at(20))]
    watched.refresh_from_db()
    assert watched.events[0]["by"] == watched.events[0]["text"] == "" and watched.person == staff
    assert timedelta(0) < watched.ends_at - watched.begins_at
