"""/move_base, /amcl_pose and /initialpose behave like TIAGo's, with real actionlib messages."""

from __future__ import annotations

import itertools
import math

import pytest
from actionlib_msgs.msg import GoalID, GoalStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from move_base_msgs.msg import MoveBaseActionFeedback, MoveBaseActionGoal, MoveBaseActionResult
from nav_msgs.msg import Odometry, Path

from robots.simulator.navigation.follower import LEFT_M, THERE_M, THERE_RAD

_numbers = itertools.count()


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


class Goals:
    """A client of the action's topics."""

    def __init__(self, goals, cancels, results) -> None:
        self.goals, self.cancels, self.results = goals, cancels, results

    def go(self, x: float, y: float, yaw: float = 0.0, frame: str = "map") -> str:
        message = MoveBaseActionGoal()
        message.goal_id.id = f"test-{next(_numbers)}"
        target = message.goal.target_pose
        target.header.frame_id = frame
        target.pose.position.x, target.pose.position.y = x, y
        target.pose.orientation.z, target.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        self.goals.publish(message)
        return message.goal_id.id

    def result(self, goal_id: str):
        return self.results.until(lambda report: report.status.goal_id.id == goal_id).status


def heading(pose) -> float:
    return 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)


@pytest.fixture
def goals(ros):
    with (
        ros.listen("/move_base/result", MoveBaseActionResult) as results,
        ros.speak("/move_base/goal", MoveBaseActionGoal) as goals,
        ros.speak("/move_base/cancel", GoalID) as cancels,
    ):
        ros.connected(results)
        yield Goals(goals, cancels, results)


@pytest.fixture
def base(ros):
    """The true pose and velocity."""
    with ros.listen("/ground_truth/pose", Odometry) as poses:
        yield poses


def test_it_plans_drives_and_arrives(ros, goals, base):
    with (
        ros.listen("/move_base/GlobalPlanner/plan", Path) as plans,
        ros.listen("/move_base/feedback", MoveBaseActionFeedback) as feedback,
    ):
        goal = goals.go(3.2, 1.8, 1.0)
        path = plans.until(lambda path: math.isclose(path.poses[-1].pose.position.x, 3.2)).poses
        assert len(path) > 5
        position = feedback.until(lambda report: report.status.goal_id.id == goal).feedback.base_position
        assert position.header.frame_id == "map"
        status = goals.result(goal)
    assert (status.status, status.text) == (GoalStatus.SUCCEEDED, "Goal reached.")
    base.until(
        lambda truth: math.dist((truth.pose.pose.position.x, truth.pose.pose.position.y), (3.2, 1.8)) < 0.2
    )


def test_a_robot_that_its_localisation_shifts_at_the_goal_turns_on(ros, goals, base):
    """Once reached, the goal's place stays reached: a robot that drives back to it would turn to and fro."""
    with ros.speak("/initialpose", PoseWithCovarianceStamped) as setter:
        start = base.next().pose.pose
        yaw = heading(start) + 3.0
        goal = goals.go(start.position.x, start.position.y, yaw)
        at = base.until(lambda truth: truth.twist.twist.angular.z > 0.3).pose.pose
        shifted = PoseWithCovarianceStamped()
        shifted.header.frame_id = "map"
        shifted.pose.pose = at
        left, off_m = heading(at) + math.pi / 2, (THERE_M + LEFT_M) / 2  # then the goal is on the right
        at.position.x += off_m * math.cos(left)
        at.position.y += off_m * math.sin(left)
        setter.publish(shifted)
        turns = []

        def has_turned(truth):
            turns.append(truth.twist.twist.angular.z)
            return abs(math.remainder(heading(truth.pose.pose) - yaw, math.tau)) < 2 * THERE_RAD

        base.until(has_turned)
        assert min(turns) > -0.1
        assert goals.result(goal).status == GoalStatus.SUCCEEDED


def test_a_cancel_stops_the_base(goals, base):
    goal = goals.go(8.0, 2.0)
    base.until(lambda truth: truth.twist.twist.linear.x > 0.2)
    goals.cancels.publish(GoalID(id=goal))
    assert goals.result(goal).status == GoalStatus.PREEMPTED
    base.until(lambda truth: abs(truth.twist.twist.linear.x) < 0.01)


def test_a_new_goal_replaces_the_running_one(goals):
    first = goals.go(8.0, 2.0)
    second = goals.go(20.0, 20.0)
    assert goals.result(first).status == GoalStatus.PREEMPTED
    status = goals.result(second)
    assert (status.status, "valid plan" in status.text) == (GoalStatus.ABORTED, True)


@pytest.mark.parametrize("wrong", [{"frame": "odom"}, {"x": math.nan}])
def test_a_goal_that_makes_no_sense_is_aborted(goals, wrong):
    assert goals.result(goals.go(**{"x": 3.0, "y": 1.8, **wrong})).status == GoalStatus.ABORTED


def test_a_person_with_a_joystick_goes_first(ros, goals, base):
    goal = goals.go(2.0, 1.8)
    with ros.speak("/joy_vel", Twist) as joystick:
        for _ in range(10):
            joystick.publish(Twist())
            base.next()
        base.until(lambda truth: (joystick.publish(Twist()), abs(truth.twist.twist.linear.x) < 0.01)[1])
    goals.cancels.publish(GoalID(id=goal))
    goals.result(goal)


def test_faults_of_navigation(goals, base, fault):
    fault("navigation_fails")
    assert goals.result(goals.go(2.5, 1.8)).status == GoalStatus.ABORTED
    fault("navigation_goes_on")
    goal = goals.go(8.0, 2.0)
    base.until(lambda truth: truth.twist.twist.linear.x > 0.2)
    goals.cancels.publish(GoalID(id=goal))
    assert goals.result(goal).status == GoalStatus.PREEMPTED
    for _ in range(50):
        moving = base.next().twist.twist
    assert moving.linear.x > 0.1 or abs(moving.angular.z) > 0.1
    fault("navigation_answers_another")
    goal = goals.go(20.0, 20.0)
    assert goals.results.until(lambda report: True).status.goal_id.id == f"{goal}-another"


def test_a_set_pose_is_believed(ros, goals):
    with (
        ros.listen("/amcl_pose", PoseWithCovarianceStamped) as poses,
        ros.speak("/initialpose", PoseWithCovarianceStamped) as setter,
    ):
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id = "map"
        pose.pose.pose.position.x, pose.pose.pose.position.y, pose.pose.pose.orientation.w = 6.0, 2.0, 1.0
        setter.publish(pose)
        believed = poses.until(lambda message: math.isclose(message.pose.pose.position.x, 6.0, abs_tol=0.01))
    assert believed.pose.covariance[0] == pytest.approx(0.25)


def test_simple_goals_are_goals(ros, goals):
    with ros.speak("/move_base_simple/goal", PoseStamped) as simple:
        pose = PoseStamped()
        pose.header.frame_id = "map"
        pose.pose.position.x, pose.pose.orientation.w = 50.0, 1.0
        simple.publish(pose)
        assert goals.results.until(lambda report: True).status.status == GoalStatus.ABORTED
