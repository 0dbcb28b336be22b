"""The map below the path: selection, position, access, retention."""

from __future__ import annotations

import io
import math
import re
from datetime import UTC, datetime, timedelta

import pytest
from django.conf import settings
from django.core.management import call_command
from django.urls import reverse
from django.utils import timezone as django_timezone

from fleet.audit.services import record
from robots.registry.maps import map_store
from robots.registry.models import RobotMap
from robots.shared.geometry.poses import Pose
from robots.shared.records.record_sink import TakenMap
from teleop.models import ControlSession, EndReason
from teleop.reports import session_maps, session_report
from teleop.reports.path_plot import AROUND_M, HEIGHT, WIDTH, DrivePath, MapImage, plot_drives
from tests.teleop.reports.test_reports import PATH, PEOPLE, browser_of

pytestmark = pytest.mark.django_db

NOON = datetime(2026, 11, 17, 12, 0, tzinfo=UTC)
MINUTE, DAY = timedelta(minutes=1), timedelta(days=1)


@pytest.fixture
def control(robot, operator):
    """`control(began, lasted=10 min)` stores a session of the operator; lasted None: it has not ended."""

    def had(began=NOON, lasted=10 * MINUTE):
        return ControlSession.objects.create(
            robot=robot,
            user=operator,
            fence=ControlSession.objects.count(),
            started_at=began,
            ended_at=began + lasted if lasted else None,
            end_reason=EndReason.RELEASED if lasted else "",
        )

    return had


@pytest.fixture
def seen(robot):
    """`seen(moment, what="a")` stores the robot's map at that moment."""

    def see(moment, what="a", on=robot):
        origin = Pose(-1.0, 2.0, 0.5)
        return map_store(on.pk, TakenMap(0.05, origin, 200, 100, f"PNG {what}".encode(), what), moment)

    return see


@pytest.fixture
def drive(robot, operator):
    """`drive(session)` records a drive along `PATH` in the map's frame."""

    def driven(session, map_to_odom=(0.0, 0.0, 0.0)):
        of_session = {"actor": operator, "robot_id": robot.pk, "session_id": session.pk}
        places = {"pose": PATH[0][1:4], "map_to_odom": map_to_odom}
        start = record("drive.start", private=places, **of_session)
        record("drive.end", of=start, outcome="standstill", private=places | {"path": PATH}, **of_session)

    return driven


def ground_of(session):
    plot = session_report.report_of(session).plot
    return plot.map_image and plot.map_image.number


# --- selection---------------------------------------------------------------------------------------


def test_unchanged_map_is_one_row_a_changed_one_another(seen):
    first = seen(NOON)
    assert seen(NOON + 5 * MINUTE) == first
    other = seen(NOON + 10 * MINUTE, "b")
    again = seen(NOON + 15 * MINUTE, "a")
    rows = RobotMap.objects.order_by("first_seen_at")
    assert list(rows.values_list("pk", "digest")) == [(first.pk, "a"), (other.pk, "b"), (again.pk, "a")]
    assert rows[0].last_seen_at == NOON + 5 * MINUTE


def test_session_is_shown_on_the_map_of_its_time(control, seen, drive, other_robot):
    session = control()
    drive(session)
    assert ground_of(session) is None
    seen(NOON - DAY, "older")
    seen(NOON + DAY, "newer")
    seen(NOON + MINUTE, "another robot's", on=other_robot)
    assert ground_of(session) is None
    RobotMap.objects.filter(digest="newer").delete()
    of_then = seen(NOON - timedelta(seconds=2), "of then")  # the bridge's clock is behind
    seen(NOON + DAY, "newer")
    assert ground_of(session) == of_then.pk


def test_newest_map_of_a_session_is_shown(control, seen, drive):
    session = control()
    drive(session)
    seen(NOON + MINUTE, "a")
    newest = seen(NOON + 6 * MINUTE, "b")
    seen(NOON + 11 * MINUTE, "c")
    assert ground_of(session) == newest.pk


def test_map_seen_by_a_clock_years_ahead_is_shown_later(control, seen, drive):
    session = control()
    drive(session)
    ahead = seen(NOON + 3650 * DAY)
    rows = {seen(NOON + minutes * MINUTE).pk for minutes in range(5)}
    assert rows == {ground_of(session)}
    assert list(RobotMap.objects.order_by("pk").values_list("pk", flat=True)) == [ahead.pk, *rows]


def test_clock_set_back_by_minutes_makes_no_second_row(seen):
    assert seen(NOON) == seen(NOON - 4 * MINUTE)


def test_path_without_pose_on_the_map_is_drawn_without_map(control, seen, drive):
    session = control()
    drive(session)
    drive(session, map_to_odom=None)
    seen(NOON + MINUTE)
    assert ground_of(session) is None


# --- position---------------------------------------------------------------------------------------


def on_the_picture(plot, x, y):
    """Return the SVG position of point x, y of the map picture (metres from its upper left corner, y down)."""
    a, b, c, d, e, f = map(float, re.fullmatch(r"matrix\((.*)\)", plot.map_transform).group(1).split())
    return a * x + c * y + e, b * x + d * y + f


@pytest.mark.parametrize("turn", [0.0, math.pi / 2.0, -2.5])
def test_map_lies_with_its_lower_left_corner_at_the_origin(turn):
    # On a map of 6 m by 3 m the robot drives from the lower left corner to the right, then up.
    origin = (7.0, -3.0, turn)
    c, s = math.cos(turn), math.sin(turn)

    def of_map(u, v):
        return 7.0 + c * u - s * v, -3.0 + s * u + c * v

    places = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.5)]
    samples = [[float(index), *of_map(*place), 0.0, 0.5] for index, place in enumerate(places)]
    plot = plot_drives([DrivePath(0.0, samples, frame=(0.0, 0.0, 0.0))], [], MapImage(1, 6.0, 3.0, origin))
    for (u, v), (_, x, y, _) in zip(places, plot.replay[0], strict=True):
        assert on_the_picture(plot, u, 3.0 - v) == pytest.approx((x, y), abs=0.2)


def test_only_the_maps_part_around_the_path_is_shown():
    samples = [[0.0, 1.0, 1.0, 0.0, 0.0], [1.0, 1.5, 1.0, 0.0, 0.5]]
    small = plot_drives(
        [DrivePath(0.0, samples, frame=(0, 0, 0))], [], MapImage(1, 2.0, 1.8, (0.0, 0.0, 0.0))
    )
    for corner in ((0.0, 0.0), (2.0, 1.8)):
        x, y = on_the_picture(small, *corner)
        assert 0.0 < x < WIDTH
        assert 0.0 < y < HEIGHT
    large = plot_drives(
        [DrivePath(0.0, samples, frame=(0, 0, 0))], [], MapImage(1, 200.0, 100.0, (-50.0, -50.0, 0.0))
    )
    left, _ = on_the_picture(large, 50.0 + 1.0 - AROUND_M, 0.0)
    assert left >= 0.0
    farther, _ = on_the_picture(large, 50.0 + 1.0 - 3.0 * AROUND_M, 0.0)
    assert farther < 0.0


# --- access -----------------------------------------------------------------------------------------


def address_of(session, found):
    return reverse("control-session-map", args=[session.pk, found.pk])


@pytest.mark.parametrize("person", PEOPLE)
def test_map_is_visible_to_people_who_may_see_the_session(person, request, signed_in, control, seen, drive):
    session = control()
    drive(session)
    found = seen(NOON + MINUTE)
    client = browser_of(person, request, signed_in)
    answer = client.get(address_of(session, found))
    page = client.get(reverse("control-session", args=[session.pk]))
    assert answer.status_code == page.status_code == PEOPLE[person][0]
    assert (address_of(session, found) in page.content.decode()) == (answer.status_code == 200)
    if answer.status_code == 200:
        assert (answer.content, answer["Content-Type"]) == (b"PNG a", "image/png")
        assert answer["X-Content-Type-Options"] == "nosniff"
        assert "private" in answer["Cache-Control"]
    else:
        assert b"PNG" not in answer.content


def test_own_session_gives_access_to_no_other_map(control, seen, signed_in, operator, other_robot):
    session = control()
    client = signed_in(operator)
    seen(NOON + MINUTE)
    for found in (seen(NOON + DAY, "later"), seen(NOON + MINUTE, "another robot's", on=other_robot)):
        assert client.get(address_of(session, found)).status_code == 404


# --- retention --------------------------------------------------------------------------------------


def kept():
    return list(RobotMap.objects.order_by("pk").values_list("digest", flat=True))


def test_map_is_kept_as_long_as_a_path_on_it(control, seen):
    control()
    seen(NOON + MINUTE)
    keep = timedelta(days=settings.FLEET_AUDIT_KEEP_DAYS["driving"])
    list(session_maps.remove_unneeded(NOON + keep))
    assert kept() == ["a"]
    list(session_maps.remove_unneeded(NOON + keep + 2 * DAY))
    assert kept() == []


def test_one_map_per_session_is_kept_of_a_mapping_robot(control, seen, other_robot):
    control()
    control(NOON + 30 * MINUTE)
    seen(NOON + 21 * MINUTE, "of another robot", on=other_robot)
    for minute in (1, 6, 31, 36, 41):
        seen(NOON + minute * MINUTE, str(minute))
    list(session_maps.remove_unneeded(NOON + 3 * 60 * MINUTE))
    assert len(kept()) == 6  # all maps are of today
    list(session_maps.remove_unneeded(NOON + 2 * DAY))
    assert kept() == ["6", "36"]


def test_removed_maps_are_those_that_no_session_shows(control, seen, drive):
    sessions = [
        control(NOON + minute * MINUTE, lasted * MINUTE) for minute, lasted in ((0, 3), (4, 20), (90, 9))
    ]
    sessions.append(control(NOON + 200 * MINUTE, lasted=None))
    for session in sessions:
        drive(session)
    for minute in (1, 2, 5, 12, 24, 26, 80, 91, 101, 201, 240):
        seen(NOON + minute * MINUTE, str(minute))
        seen(NOON + (minute + 0.5) * MINUTE, str(minute))
    shown = [ground_of(session) for session in sessions]
    list(session_maps.remove_unneeded(NOON + 3 * DAY))
    assert [ground_of(session) for session in sessions] == shown
    assert set(shown) == set(RobotMap.objects.values_list("pk", flat=True))


@pytest.mark.django_db(transaction=True)
def test_housekeeping_removes_maps(seen):
    seen(NOON - 2 * DAY)
    call_command("run_housekeeping", "--once")
    assert kept() == []


@pytest.mark.django_db(transaction=True)
def test_clock_years_ahead_removes_no_map(control, seen, drive, monkeypatch):
    drive(control())
    seen(NOON + MINUTE)
    monkeypatch.setattr(django_timezone, "now", lambda: NOON + 3 * 365 * DAY)
    call_command("run_housekeeping", "--once")
    assert kept() == ["a"]
    call_command("confirm_clock", stdout=io.StringIO())
    call_command("run_housekeeping", "--once")
    assert kept() == []
