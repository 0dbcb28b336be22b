"""After a restart of robot, master or map server, no goal is accepted until the present map has been read."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import pytest

from robots.bridge.navigation.localisation import MISSING, Localisation, Spread
from robots.bridge.navigation.navigation_goals import OTHER_MAP
from robots.shared import wire
from robots.shared.configuration.bridge_config import NavigationSource, Topic
from robots.shared.geometry.poses import Pose
from robots.shared.maps.goal_map import UNKNOWN_NOW
from tests.bridge.support import CONFIG, Bench

TOPICS = msgspec.structs.replace(
    CONFIG.topics,
    navigation=NavigationSource("/move_base", "/nav_vel", "/amcl_pose", set_pose="/initialpose"),
    map=Topic("/map", "nav_msgs/OccupancyGrid"),
)
CONTROLLED_S = 10.0  # longer than the first seconds of control, in which goals wait


class FreeMap:
    def __init__(self, digest: str) -> None:
        self.digest = digest

    def refuse(self, goal, footprint):
        return None


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=TOPICS)).online().granted()
    bench.core.tasks.navigation.mapped(FreeMap("old"), bench.now_s)
    bench.pass_time(CONTROLLED_S)
    located(bench)
    yield bench
    bench.close()


def located(bench: Bench) -> None:
    navigation = bench.core.tasks.navigation
    navigation.localisation.posed(Pose(1.0, 0.0, 0.0), Spread(0.01, 0.0, 0.01, 0.01), bench.now_s)
    bench.base.transform = (bench.now_s, Pose(1.0, 0.0, 0.0))
    bench.pass_time(0.1)


def go(bench: Bench, map: str = "") -> wire.Refusal | None:
    answers = bench.ask(wire.Go(1, 3.0, 1.0, 0.5, seq=7, map=map))
    bench.recorded()
    bench.pass_time(0.1)
    return answers[0]


def pose(bench: Bench, map: str = "") -> wire.Refusal | None:
    answers = bench.ask(wire.SetPose(1, 3.0, 1.0, 0.5, seq=8, map=map))
    bench.recorded()
    bench.pass_time(0.1)
    return answers[0]


@pytest.mark.parametrize("map", ["", "old", "new"])
def test_after_a_restart_goals_wait_for_the_present_map(bench, map):
    bench.core.restarting(bench.now_s)
    located(bench)
    assert go(bench, map) == pose(bench, map) == UNKNOWN_NOW
    bench.pass_time(20.0)
    located(bench)
    assert go(bench, map) == UNKNOWN_NOW and bench.base.goals == []
    bench.core.tasks.navigation.mapped(FreeMap("new"), bench.now_s)
    located(bench)
    assert go(bench, map) == (OTHER_MAP if map == "old" else None)


def test_the_same_map_after_a_restart_is_good_again(bench):
    bench.core.restarting(bench.now_s)
    bench.core.tasks.navigation.mapped(FreeMap("old"), bench.now_s)
    assert go(bench, "old") == MISSING  # where the robot was before its restart
    located(bench)
    assert go(bench, "old") is None


def test_a_pose_on_another_map_is_none(bench):
    bench.core.tasks.navigation.mapped(FreeMap("new"), bench.now_s)
    assert go(bench) == MISSING
    assert bench.core.state(bench.now_s, []).location is None
    bench.pass_time(0.5)  # the transform of the old map is still the newest one
    assert go(bench) == MISSING


def test_a_robot_whose_map_cannot_be_read_stays_without_goals(bench):
    bench.core.restarting(bench.now_s)
    bench.core.tasks.navigation.unmapped("nobody publishes /map", bench.now_s)
    located(bench)
    assert go(bench).code == "no_map"


def test_a_pose_in_the_first_seconds_waits_for_the_map():
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=TOPICS)).online().granted()
    answers = bench.ask(wire.SetPose(1, 3.0, 1.0, 0.5, seq=8, map="new"))
    bench.pass_time(0.5)
    again = bench.ask(wire.SetPose(1, 3.0, 1.5, 0.5, seq=9, map="new"))
    bench.recorded()
    bench.pass_time(1.0)
    assert answers == again == [] and bench.base.poses == []
    bench.core.tasks.navigation.mapped(FreeMap("new"), bench.now_s)
    bench.pass_time(0.1)
    assert answers == again == [None] and bench.base.poses == [Pose(3.0, 1.5, 0.5)]
    bench.close()


def test_a_pose_on_the_map_before_is_refused_when_the_map_comes():
    bench = Bench(config=msgspec.structs.replace(CONFIG, topics=TOPICS)).online().granted()
    answers = bench.ask(wire.SetPose(1, 3.0, 1.0, 0.5, seq=8, map="old"))
    bench.recorded()
    bench.core.tasks.navigation.mapped(FreeMap("new"), bench.now_s)
    bench.pass_time(0.1)
    assert answers == [OTHER_MAP] and bench.base.poses == []
    bench.close()


def test_a_pose_waits_for_odometry_of_its_run():
    """A robot that stands tells its pose once."""
    place = Localisation()
    for odometry in (Pose(0.5, 0.0, 0.0), Pose(0.0, 0.0, 0.0)):
        place.forget()
        place.posed(Pose(3.0, 1.0, 0.5), Spread(), 1.0)
        assert place.pose is None
        place.moved(odometry)
        assert place.pose == pytest.approx((3.0, 1.0, 0.5))
