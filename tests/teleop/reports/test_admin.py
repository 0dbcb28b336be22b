"""The read-only list of control sessions in the admin."""

from datetime import datetime, timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from fleet.accounts.services import account_erase
from fleet.audit.models import Record
from fleet.audit.services import record
from teleop.models import ControlSession, EndReason
from tests.teleop.support import store_sessions

pytestmark = pytest.mark.django_db

LIST = reverse("admin:teleop_controlsession_changelist")


@pytest.fixture
def ended(robot, operator, supervisor):
    """A session that a supervisor ended."""
    now = timezone.now()
    session = ControlSession.objects.create(
        robot=robot,
        user=operator,
        fence=1,
        started_at=now - timedelta(minutes=5),
        ended_at=now,
        end_reason=EndReason.TAKEN_OVER,
    )
    words = {"words": "Sue Pervisor took over: a visitor in the way."}
    record("control.end", actor=supervisor, robot_id=robot.id, session_id=session.id, private=words)
    return session


@pytest.fixture
def running(other_robot, staff):
    """A session that has not ended."""
    return ControlSession.objects.create(robot=other_robot, user=staff, fence=1, started_at=timezone.now())


def listed(client, **filters):
    """Return the holders of the listed sessions, newest first."""
    days = client.get(LIST, filters).context["days"]
    return [line.who for _day, _address, lines in days for line in lines]


def test_list_shows_holder_robot_duration_and_end_reason(staff, signed_in, ended):
    page = signed_in(staff).get(LIST).content.decode()
    for words in ("TIAGo 1", "Olga Operator", "0:05:00", "taken over", "a visitor in the way"):
        assert words in page


def test_sessions_are_filtered_by_robot_person_reason_and_day(staff, signed_in, ended, running):
    client = signed_in(staff)
    assert listed(client) == ["Sam Staff", "Olga Operator"]
    assert listed(client, robot=str(ended.robot_id)) == ["Olga Operator"]
    assert listed(client, person=str(ended.user_id)) == ["Olga Operator"]
    assert listed(client, outcome="taken_over") == ["Olga Operator"]
    assert listed(client, outcome="goes_on") == ["Sam Staff"]
    long_ago = ended.started_at.date() - timedelta(days=30)
    assert listed(client, until=long_ago) == []
    assert listed(client, since=long_ago) == ["Sam Staff", "Olga Operator"]


def test_pages_show_every_session_once(staff, operator, robot, signed_in):
    now = timezone.now()
    store_sessions(robot, operator, (now - timedelta(hours=number) for number in range(120)), now)
    client = signed_in(staff)
    context, found = client.get(LIST).context, []
    assert context["count"] == "120"
    while True:
        found += [line.what for _day, _address, lines in context["days"] for line in lines]
        if "older" not in context:
            break
        context = client.get(LIST + context["older"]).context
    assert found == [f"had control for {number}:00:00" for number in range(120)]
    assert "newer" in context
    assert len(client.get(LIST + context["newer"]).context["days"]) > 0


def test_sessions_that_began_together_share_a_page(staff, operator, robot, signed_in, monkeypatch):
    """Many sessions can begin at one moment: after a restart of all bridges, or by a script."""
    monkeypatch.setattr("teleop.admin.PAGE", 3)
    now = timezone.now()
    store_sessions(robot, operator, (now - timedelta(minutes=number // 4) for number in range(12)), now)
    client, sessions = signed_in(staff), ControlSession.objects.order_by("-started_at", "-pk")
    everything = [f"/sessions/{session.pk}/" for session in sessions]
    pages = [client.get(LIST).context]
    while "older" in pages[-1]:
        pages.append(client.get(LIST + pages[-1]["older"]).context)
    assert [url for page in pages for url in urls(page)] == everything
    while "newer" in pages[-1]:
        pages.append(client.get(LIST + pages[-1]["newer"]).context)
    back = [url for page in reversed(pages[len(pages) // 2 :]) for url in urls(page)]
    assert back == everything


def urls(page):
    return [line.url for _day, _address, lines in page["days"] for line in lines]


def test_list_of_one_day_links_to_neighbouring_days(staff, operator, robot, signed_in):
    noon = datetime(2026, 11, 3, 12, tzinfo=timezone.get_default_timezone())
    for fence, days in enumerate((-4, 0, 2)):
        ControlSession.objects.create(
            robot=robot, user=operator, fence=fence, started_at=noon + timedelta(days=days), ended_at=noon
        )
    context = signed_in(staff).get(LIST, {"since": "2026-11-03", "until": "2026-11-03"}).context
    assert context["day_before"].text == "2026-10-30"
    assert context["day_after"].text == "2026-11-05"


def test_sessions_cannot_be_edited_added_or_deleted(staff, signed_in, ended):
    client = signed_in(staff)
    assert client.post(LIST, {"end_reason": "term"}).status_code == 405
    for page in ("add/", f"{ended.pk}/change/", f"{ended.pk}/delete/"):
        assert client.post(f"{LIST}{page}", {"post": "yes"}).status_code == 404
    ended.refresh_from_db()
    assert ended.end_reason == EndReason.TAKEN_OVER


def test_erasing_a_person_erases_the_words(staff, supervisor, signed_in, ended):
    account_erase(user=supervisor, actor=staff)
    page = signed_in(staff).get(LIST).content.decode()
    assert "taken over" in page
    assert "Sue" not in page and "a visitor in the way" not in page


def test_operator_cannot_open_the_list(operator, signed_in):
    assert signed_in(operator).get(LIST).status_code in (302, 403)


def test_export_needs_the_right_to_see_the_list(operator, signed_in, ended):
    assert signed_in(operator).post(f"{LIST}export/", {"format": "csv"}).status_code in (302, 403)
    assert not Record.objects.filter(kind="audit.export").exists()
