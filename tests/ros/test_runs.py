"""Another publisher of odometry, or another run of the master, is another run of the robot."""

from __future__ import annotations

from robots.bridge.ros.runs import Runs


def test_each_connection_and_each_run_of_the_master_is_a_run_of_its_own():
    runs, first, second = Runs(), {"callerid": "/base"}, {"callerid": "/base"}
    numbers = [runs.of(first), runs.of(first), runs.of(second)]
    runs.begin()
    numbers += [runs.of(second), runs.of(first), runs.of(second)]
    assert numbers == [1, 1, 2, 3, 3, 3], "two that publish in turn are no new ones each time"
