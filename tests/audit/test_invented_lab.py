"""The invented history of `script/bench audit` could have been recorded by the console."""

import pytest

from benchmarks.audit.history_writer import Past
from benchmarks.audit.invented_lab import RARE_OUTCOME
from fleet.audit.integrity.verify import verify_all
from fleet.audit.kinds import KINDS
from fleet.audit.models import Record
from fleet.audit.services import record
from robots.registry.models import Robot
from teleop.models import ControlSession
from teleop.reports import robot_report, session_report

pytestmark = pytest.mark.django_db
COUNT = 1500  # invented records; one real record is older


@pytest.fixture
def past():
    record("account.sign_in")
    past = Past()
    past.grow(COUNT // 2)
    past.grow(COUNT)
    return past


def test_it_verifies_and_has_kinds_that_are_known(past):
    assert Record.objects.filter(at__lte=past.newest).count() == COUNT
    assert verify_all().findings == []
    kinds = set(Record.objects.values_list("kind", flat=True))
    assert kinds <= set(KINDS)
    assert {"drive.end", "control.end", "refusal", "camera.end", "account.sign_in"} <= kinds
    assert not kinds & {"control.release", "control.expire"}  # no longer recorded


def test_its_drives_are_as_bridges_record_them(past):
    for end in Record.objects.filter(kind="drive.end").exclude(outcome=RARE_OUTCOME):
        assert {*end.parameters} == {"distance_m", "duration_s", "top_mps", "top_radps", "interventions"}
        assert {*end.content.data} == {"words", "path", "path_tolerance_m", "pose", "map_to_odom"}


def test_the_reports_have_something_to_show(past):
    robot = Robot.objects.get(slug="tiago-1")
    report = robot_report.report_of(robot, 365, past.newest)
    assert min(report.drives, report.driven_h, report.distance_m, report.interventions, report.stops) > 0
    session = ControlSession.objects.filter(robot=robot).exclude(ended_at=None)[0]
    assert session_report.report_of(session).entries
