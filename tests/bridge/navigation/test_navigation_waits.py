"""If sensors are silent for a moment, a robot that drives itself waits and drives on. With the real gate."""

import math

import msgspec
import numpy as np
import pytest

from robots.bridge.gate.gate import Gate
from robots.bridge.gate.values import LaserScan
from robots.bridge.navigation.localisation import Spread
from robots.bridge.navigation.sensor_grace import SETTLES_S, WAITS_S, WELL_S, SensorGrace
from robots.bridge.robot_reports import RosStatus
from robots.shared import wire
from robots.shared.configuration.bridge_config import NavigationSource, Topic
from robots.shared.geometry.poses import STILL, Pose, Velocity
from tests.bridge.support import CONFIG, Bench

TOPICS = msgspec.structs.replace(
    CONFIG.topics,
    navigation=NavigationSource("/move_base", "/nav_vel", "/amcl_pose", set_pose="/initialpose"),
    map=Topic("/map", "nav_msgs/OccupancyGrid"),
)
PROFILE = msgspec.structs.replace(CONFIG.gate, scan_poses={"scan": (0.2, 0.0, 0.0)})
SPEED = Velocity(0.4, 0.0, 0.0)
STEP_S = 0.02
BEARINGS = np.radians(np.arange(-90, 91))


class FreeMap:
    digest = "free"

    def refuse(self, goal, footprint):
        return None


class SelfDriver(Bench):
    """A robot with a laser that drives itself towards a wall at x = `wall_m`."""

    def __init__(self, wall_m=8.0):
        config = msgspec.structs.replace(CONFIG, topics=TOPICS, gate=PROFILE)
        super().__init__(config=config, gate=Gate(PROFILE))
        self.wall_m = wall_m
        self.kept: list[tuple[float, float]] = []  # odometry that has not arrived: stamp and x
        self.navigation = self.core.tasks.navigation
        self.core.ros_status(RosStatus("connecting", ""), self.now_s)
        self.odometry(STILL)
        self.core.tasks.navigation.mapped(FreeMap(), self.now_s)
        self.navigation.localisation.posed(Pose(0.0, 0.0, 0.0), Spread(0.01, 0.0, 0.01, 0.01), self.now_s)
        self.steps(0.5)
        self.ask(wire.Go(1, 3.0, 1.0, 0.5, seq=7))
        self.recorded()
        self.steps(0.2)
        self.speed = SPEED
        self.steps(1.0)
        assert self.navigation.driving_requester and not self.navigation.holds_for_sensor

    def steps(self, seconds, odometry=True, scans=True):
        """Let time pass. Without `odometry`, its messages are kept until `arrive`."""
        for _ in range(round(seconds / STEP_S)):
            self.now_s = round(self.now_s + STEP_S, 4)
            self.stamp_s = round(self.stamp_s + STEP_S, 4)
            self.x += self.speed.vx * STEP_S
            self.kept.append((self.stamp_s, self.x))
            if odometry:
                self.arrive()
            if scans and round(self.now_s / STEP_S) % 4 == 0:
                self.scan()
            self.base.transform = (self.now_s, Pose(0.0, 0.0, 0.0))
            self.core.grant(wire.Grant(1, 60.0, "session-1", "Ann", "ann-id", 1.0), 1, self.now_s)
            if self.base.goals:
                goal_id = self.base.goals[-1][0]
                self.navigation.running("/move_base", [goal_id], self.now_s)
                self.navigation.answered(goal_id, self.now_s)
                self.navigation.drove(self.speed, self.now_s)
            self.core.tick(self.now_s)
            self.recorded()

    def arrive(self):
        """Let all kept odometry arrive now, message after message."""
        for stamp_s, x in self.kept:
            self.core.odometry(stamp_s, self.now_s, Pose(x, 0.0, 0.0), self.speed, stamp_s)
        self.kept.clear()

    def scan(self, ahead_s=0.0):
        away_m = self.wall_m - 0.2 - self.x
        with np.errstate(divide="ignore"):
            ranges = np.where(np.abs(BEARINGS) < 1.4, away_m / np.cos(BEARINGS), 30.0)
        self.core.laser(
            LaserScan(
                "scan",
                self.stamp_s - 0.01 + ahead_s,
                self.now_s,
                tuple(np.minimum(ranges, 25.0).tolist()),
                -math.pi / 2,
                math.radians(1.0),
                0.05,
                25.0,
            )
        )

    def zeros(self, run):
        """Call `run`; return how many zeros were sent. Nothing else may be sent."""
        before = len(self.base.sent)
        run()
        sent = self.base.sent[before:]
        assert set(sent) <= {STILL}
        return len(sent)

    @property
    def end(self):
        """Why the drive was given up; None: the drive goes on."""
        current = self.navigation._current
        return self.navigation.last.because if current is None else current.what.because


@pytest.fixture
def driver():
    driver = SelfDriver()
    yield driver
    driver.close()


def test_it_is_silent_while_all_is_well(driver):
    assert driver.zeros(lambda: driver.steps(2.0)) == 0


@pytest.mark.parametrize("lost_s", [0.22, 0.28])
def test_lost_odometry_holds_the_base_and_the_drive_goes_on(driver, lost_s):
    driver.steps(lost_s, odometry=False)
    driver.kept.clear()
    driver.steps(SETTLES_S)
    assert driver.navigation.holds_for_sensor and driver.last == STILL
    driver.steps(0.3)
    assert driver.navigation.driving_requester and not driver.navigation.holds_for_sensor
    assert driver.zeros(lambda: driver.steps(1.5)) == 0
    assert [kind for kind in driver.sink.kinds if kind.startswith("gate")] == ["gate.begin", "gate.end"]


@pytest.mark.parametrize("late_s", [0.3, 0.4, 0.6])
def test_odometry_that_comes_late_in_a_burst_does_not_end_a_drive(driver, late_s):
    driver.steps(late_s, odometry=False)
    driver.arrive()
    driver.scan()
    assert driver.zeros(lambda: driver.steps(0.06)) == 3  # one each period: the hold ends later
    driver.steps(0.2)
    assert driver.navigation.driving_requester
    assert driver.zeros(lambda: driver.steps(0.5)) == 0


def test_a_late_process_beside_a_wall_does_not_end_a_drive():
    driver = SelfDriver()
    driver.wall_m = driver.x + 0.43 + 0.27 + 0.4 * 0.02
    driver.scan()
    driver.speed = STILL  # the robot stands before the wall when the late messages arrive
    for _ in range(20):  # the bridge's process is blocked
        driver.now_s, driver.stamp_s = driver.now_s + STEP_S, driver.stamp_s + STEP_S
        driver.kept.append((driver.stamp_s, driver.x))
    driver.speed = SPEED
    driver.arrive()  # old messages report that the robot drives
    assert driver.navigation.holds_for_sensor and driver.end is None and driver.last == STILL
    driver.close()


def test_a_silent_laser_holds_the_base_with_zeros_without_a_gap(driver):
    driver.steps(0.5, scans=False)
    assert driver.zeros(lambda: driver.steps(0.5, scans=False)) >= 25
    state = driver.core.state(driver.now_s, [])
    assert (state.verdict.code, state.verdict.sensor) == ("scan_stale", "scan")
    assert driver.navigation.driving_requester
    driver.steps(0.4, scans=False)
    assert driver.end == "scan_stale" and driver.last == STILL


def test_a_drive_ended_by_an_overloaded_computer_names_it(driver):
    driver.core.tick(driver.now_s, late_s=0.8)
    driver.steps(1.5, scans=False)
    said = "Stopped: laser is 1.3 s old; this computer is overloaded: the bridge was 0.8 s late."
    assert driver.end == "scan_stale"
    driver.navigation.ended(driver.base.goals[-1][0], "cancelled", "", driver.now_s)
    assert driver.navigation.last.text == said


def test_a_scan_that_comes_before_its_odometry_does_not_end_a_drive(driver):
    driver.scan(ahead_s=0.3)
    driver.steps(0.04, scans=False)
    assert driver.navigation.holds_for_sensor and driver.last == STILL
    driver.steps(0.6)
    assert driver.navigation.driving_requester and not driver.navigation.holds_for_sensor


def test_the_wait_for_several_sensors_is_one(driver):
    driver.steps(0.4, odometry=False)
    driver.steps(0.5, scans=False)
    driver.steps(0.65, scans=False)
    assert driver.end == "scan_stale"


def test_a_laser_that_stutters_ends_a_drive(driver):
    for _ in range(12):
        driver.steps(0.72, scans=False)
        driver.scan()
    assert driver.end == "scan_stale"


@pytest.mark.parametrize("silent_s", [0.0, 0.24])
def test_another_robot_ends_a_drive_at_once(driver, silent_s):
    driver.steps(silent_s, odometry=False)
    stamp_s = driver.stamp_s - 0.5  # not newer than the last one
    driver.core.odometry(stamp_s, driver.now_s, Pose(7.0, 0.0, 0.0), STILL, stamp_s, run=5)
    assert driver.end == "odometry_anew" and driver.last == STILL


def test_a_hole_in_the_odometry_ends_no_drive(driver):
    """The odometry is the same robot's: only a silence that lasts ends the drive."""
    driver.steps(0.4, odometry=False)
    driver.kept.clear()
    driver.steps(0.5)
    assert driver.navigation.driving_requester and not driver.navigation.holds_for_sensor


DURING = {
    "stick": lambda driver: driver.stick(0.3),
    "cancel": lambda driver: driver.order(wire.GoCancel(1)),
    "stop": lambda driver: driver.core.stop("Bob", "", driver.now_s),
    "page gone": lambda driver: driver.core.pause(1, "the page left", 1, driver.now_s),
    "control taken": lambda driver: driver.core.revoke(1, "control was taken", driver.now_s),
    "failed": lambda driver: driver.navigation.ended(driver.base.goals[-1][0], "failed", "", driver.now_s),
}


@pytest.mark.parametrize("cause", DURING)
def test_all_that_ends_a_drive_ends_it_during_a_wait(driver, cause):
    driver.steps(0.7, scans=False)
    assert driver.navigation.holds_for_sensor
    DURING[cause](driver)
    assert driver.navigation.driving_requester is None
    driver.scan()
    assert driver.zeros(lambda: driver.core.tick(driver.now_s)) >= 1  # the bridge still holds the base


def test_short_faults_that_recur_use_up_the_grace():
    grace, at_s, held = SensorGrace(), 10.0, 0
    while grace.note_fault(at_s):
        grace.note_no_fault(at_s + SETTLES_S + 0.01)
        at_s, held = at_s + 0.15, held + 1
        assert held < 20
    assert held == 7


def test_grace_returns_after_a_time_without_a_fault():
    grace = SensorGrace()
    assert grace.note_fault(10.0) and grace.note_fault(10.5)
    grace.note_no_fault(10.51 + SETTLES_S)
    assert not grace.holds
    assert grace.note_fault(11.0) and not grace.note_fault(11.2)  # before `WELL_S`: holds add up
    grace.note_no_fault(12.0)
    assert grace.note_fault(11.2 + WELL_S + 0.1) and grace.note_fault(11.2 + WELL_S + WAITS_S)
