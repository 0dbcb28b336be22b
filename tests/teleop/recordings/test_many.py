"""A list of many recordings is read in one walk over the person's sessions."""

from __future__ import annotations

import time

import pytest

from fleet.accounts.models import User
from robots.recordings.models import Recording
from robots.registry.models import Robot
from teleop.models import ControlSession
from teleop.recordings.selectors import recordings_of
from tests.teleop.recordings.test_sight import at

pytestmark = pytest.mark.django_db


def test_ten_thousand_recordings_and_two_thousand_sessions(
    robot: Robot, operator: User, second_operator: User
) -> None:
    people = operator, second_operator
    ControlSession.objects.bulk_create(
        ControlSession(
            robot=robot,
            user=people[number % 2],
            fence=number + 1,
            started_at=at(-60 * number),
            ended_at=at(-60 * number + 30),
        )
        for number in range(2000)
    )
    Recording.objects.bulk_create(
        Recording(
            robot=robot, kind="black_box", begins_at=at(-12 * number), ends_at=at(5 - 12 * number), file="a"
        )
        for number in range(10_000)
    )
    began_s = time.process_time()
    count = recordings_of(operator).count()
    took_s = time.process_time() - began_s
    assert (
        count == 2998
    )  # of each session those that begin at its minutes 0, 12 and 24; of the last only the first
    assert took_s < 0.3  # the goal of the whole page
