"""Control sessions in the admin: who, what, from when to when, and why it ended. To read."""

from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from teleop.models import ControlSession, EndReason

pytestmark = pytest.mark.django_db

LIST = reverse("admin:teleop_controlsession_changelist")


@pytest.fixture
def ended(robot, operator):
    """A session that a supervisor ended."""
    now = timezone.now()
    return ControlSession.objects.create(
        robot=robot,
        user=operator,
        fence=1,
        started_at=now - timedelta(minutes=5),
        ended_at=now,
        end_reason=EndReason.TAKEN_OVER,
        end_note="Sue Pervisor took over: a visitor in the way.",
    )


@pytest.fixture
def running(other_robot, staff):
    """A session that goes on."""
    return ControlSession.objects.create(robot=other_robot, user=staff, fence=1, started_at=timezone.now())


def listed(client, **filters):
    return list(client.get(LIST, filters).context["cl"].queryset)


def test_the_list_says_who_had_which_robot_and_why_it_ended(staff, signed_in, ended):
    page = signed_in(staff).get(LIST).content.decode()
    for words in ("TIAGo 1", "Olga Operator", "taken over", "a visitor in the way"):
        assert words in page


def test_sessions_are_found_by_robot_reason_and_whether_they_go_on(staff, signed_in, ended, running):
    client = signed_in(staff)
    assert listed(client) == [running, ended]
    assert listed(client, robot__id__exact=str(ended.robot_id)) == [ended]
    assert listed(client, end_reason__exact="taken_over") == [ended]
    assert listed(client, ended_at__isempty="1") == [running]
    assert listed(client, q="Olga") == [ended]


def test_nobody_edits_adds_or_deletes_one(staff, signed_in, ended):
    client = signed_in(staff)
    change = reverse("admin:teleop_controlsession_change", args=[ended.pk])
    assert client.get(change).status_code == 200
    assert client.post(change, {"end_note": "nothing happened"}).status_code == 403
    assert client.post(reverse("admin:teleop_controlsession_add")).status_code == 403
    delete = reverse("admin:teleop_controlsession_delete", args=[ended.pk])
    assert client.post(delete, {"post": "yes"}).status_code == 403
    ended.refresh_from_db()
    assert ended.end_note == "Sue Pervisor took over: a visitor in the way."


def test_an_operator_has_no_business_there(operator, signed_in):
    assert signed_in(operator).get(LIST).status_code in (302, 403)
