"""How long recordings stay, and how much a person and a robot may have."""

from __future__ import annotations

import os
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from fleet.accounts.models import User
from fleet.audit.models import Record
from robots.recordings.models import Place, Recording
from robots.recordings.retention import remove_expired
from robots.registry.models import Robot
from robots.shared.wire import NotDone
from teleop.recordings import downloads
from teleop.recordings.orders.quota import check_quota
from tests.teleop.recordings.test_sight import BEGAN, recorded

pytestmark = pytest.mark.django_db
__all__ = ["recorded"]


def test_each_kind_goes_after_its_days_and_what_is_kept_stays(recorded: Any, settings: Any) -> None:
    settings.FLEET_RECORDINGS_KEEP_DAYS = {"black_box": 2, "by_hand": 5, "booking": 9}
    rows = {kind: recorded() for kind in ("black_box", "by_hand", "booking")}
    for kind, row in rows.items():
        Recording.objects.filter(pk=row.pk).update(kind=kind)
    kept = recorded(kept_at=BEGAN)

    def left(days: float) -> list[str]:
        for _ in remove_expired(BEGAN + timedelta(days=days, hours=1)):
            pass
        there = Recording.objects.exclude(place=Place.GONE).exclude(pk=kept.pk)
        return sorted(there.values_list("kind", flat=True))

    assert left(1) == ["black_box", "booking", "by_hand"]
    assert left(2) == left(4) == ["booking", "by_hand"]
    assert left(5) == ["booking"] and left(99) == []
    kept.refresh_from_db()
    assert kept.place == Place.DIRECTORY
    records = (
        Record.objects.filter(kind="recording.expire").order_by("pk").values_list("parameters", flat=True)
    )
    assert [one["recordings"] for one in records] == ["black_box", "by_hand", "booking"]
    Recording.objects.filter(place=Place.GONE).update(file="")
    assert left(9999) == [] and list(Recording.objects.all()) == [kept]


def test_files_of_downloads_that_vanish_do_not_end_the_housekeeping(settings: Any, tmp_path: Path) -> None:
    settings.FLEET_VAR = tmp_path
    (tmp_path / "downloads").mkdir()
    old = [tmp_path / "downloads" / f"{number}.bag" for number in range(3)]
    for path in old:
        path.touch()
        os.utime(path, (0, 0))
    (tmp_path / "downloads" / "gone.bag").symlink_to(
        "nothing"
    )  # as if another process removed it after the look
    downloads.remove_old()
    assert not any(path.exists() for path in old)


def test_a_new_recording_is_refused_beyond_the_quotas(
    recorded: Any, robot: Robot, operator: User, second_operator: User, settings: Any
) -> None:
    settings.FLEET_RECORDINGS_PERSON_BYTES, settings.FLEET_RECORDINGS_ROBOT_BYTES = 1000, 1500
    recorded(person=operator, bytes=5000, place=Place.GONE)
    Recording.objects.filter(pk=recorded(person=operator, bytes=5000).pk).update(kind="black_box")
    check_quota(robot.pk, operator)
    recorded(person=operator, bytes=1000)
    with pytest.raises(NotDone) as refused:
        check_quota(robot.pk, operator)
    assert refused.value.refusal.code == "person_quota"
    check_quota(robot.pk, second_operator)
    recorded(bytes=500)
    for person in (second_operator, None):
        with pytest.raises(NotDone) as refused:
            check_quota(robot.pk, person)
        assert refused.value.refusal.code == "robot_quota"
