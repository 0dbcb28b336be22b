"""A page reports the age of the picture by which its person drives; each step goes to the bridge at once."""

from types import SimpleNamespace

import pytest

from teleop.live import camera_view_age
from teleop.live.camera_view_age import CameraViewAge


@pytest.fixture
def now(monkeypatch):
    """The clock, which the test sets."""
    clock = {"s": 100.0}
    monkeypatch.setattr(camera_view_age, "time", SimpleNamespace(monotonic=lambda: clock["s"]))
    return clock


def test_the_bridge_is_told_of_each_further_step(now):
    age = CameraViewAge()
    reported_ms = [40, 300, 510, 600, 720, 800, 40, 60]
    assert [age.observe(float(ms)) for ms in reported_ms] == [
        False,
        False,
        True,
        False,
        True,
        False,
        True,
        False,
    ]


def test_a_page_that_reports_no_more_has_an_older_picture(now):
    age = CameraViewAge()
    assert age.age_s() is None
    age.observe(300.0)
    now["s"] += 2.0
    assert age.age_s() == pytest.approx(2.3)
    assert not age.observe(None)
    assert age.age_s() is None


def test_the_bridge_learns_at_once_that_nobody_drives_by_it(now):
    age = CameraViewAge()
    age.observe(9000.0)
    assert not age.observe(9400.0)
    assert age.observe(None)
