"""/head_controller/point_head_action turns the head towards a point, with real ROS messages."""

from __future__ import annotations

import itertools

import pytest
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from geometry_msgs.msg import Point, Vector3
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.shared.ros.message_types.classes import message_class

ACTION = "/head_controller/point_head_action"
_numbers = itertools.count()


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


@pytest.fixture
def look(ros):
    """``look(x, y, z, frame="base_footprint", **goal)`` returns the goal's id; `look.result(id)` waits for the end."""
    kinds = {
        part: message_class(f"control_msgs/PointHeadAction{part}") for part in ("Goal", "Result", "Feedback")
    }
    with (
        ros.listen(f"{ACTION}/result", kinds["Result"]) as results,
        ros.listen(f"{ACTION}/feedback", kinds["Feedback"]) as feedback,
        ros.speak(f"{ACTION}/goal", kinds["Goal"]) as goals,
        ros.speak(f"{ACTION}/cancel", GoalID) as cancels,
    ):
        ros.connected(results, feedback)

        def begin(
            x, y, z, frame="base_footprint", pointing_frame="xtion_rgb_optical_frame", slowly=False
        ) -> str:
            message = kinds["Goal"]()
            message.goal_id.id = f"test-{next(_numbers)}"
            message.goal.target.header.frame_id = frame
            message.goal.target.point = Point(x, y, z)
            message.goal.pointing_frame = pointing_frame
            message.goal.pointing_axis = Vector3(0.0, 0.0, 1.0)
            message.goal.min_duration = rospy.Duration(30 if slowly else 0)
            goals.publish(message)
            return message.goal_id.id

        begin.result = lambda goal_id: (
            results.until(lambda report: report.status.goal_id.id == goal_id).status
        )
        begin.feedback = lambda goal_id: (
            feedback.until(lambda report: report.status.goal_id.id == goal_id).feedback
        )
        begin.cancel = lambda goal_id: cancels.publish(GoalID(id=goal_id))
        yield begin


def joint(ros, name: str) -> float:
    with ros.listen("/joint_states", JointState) as states:
        states.settle()
        message = states.next()
    return message.position[message.name.index(name)]


def test_it_looks_at_the_floor_ahead(ros, look):
    assert look.result(look(1.2, 0.0, 0.0)).status == GoalStatus.SUCCEEDED
    assert joint(ros, "head_1_joint") == pytest.approx(0.0, abs=0.01)
    assert joint(ros, "head_2_joint") < -0.5


def test_a_target_of_the_odometrys_frame_is_looked_at(ros, look):
    assert look.result(look(2.0, 2.0, 1.2, frame="odom")).status == GoalStatus.SUCCEEDED
    assert joint(ros, "head_1_joint") > 0.5


def test_what_lies_behind_ends_at_the_necks_limit_and_is_aborted(ros, look):
    assert look.result(look(-2.0, 1.0, 1.2)).status == GoalStatus.ABORTED
    assert joint(ros, "head_1_joint") == pytest.approx(1.309, abs=0.001)


def test_errors_are_reported_and_a_cancel_stops_the_head(ros, look):
    look.result(look(2.0, 0.0, 1.2))
    goal = look(1.0, 1.0, 1.2, slowly=True)
    assert look.feedback(goal).pointing_angle_error > 0.5
    look.cancel(goal)
    assert look.result(goal).status == GoalStatus.PREEMPTED
    assert joint(ros, "head_1_joint") < 0.4


def test_a_new_goal_replaces_the_old_one(look):
    first = look(1.0, 1.0, 1.2, slowly=True)
    second = look(2.0, 0.0, 1.2)
    assert look.result(first).status == GoalStatus.PREEMPTED
    assert look.result(second).status == GoalStatus.SUCCEEDED


def test_a_trajectory_takes_the_head_over(ros, look):
    goal = look(1.0, 1.0, 1.2, slowly=True)
    look.feedback(goal)
    with ros.speak("/head_controller/command", JointTrajectory) as command:
        point = JointTrajectoryPoint(positions=[0.0, 0.0], time_from_start=rospy.Duration(1))
        command.publish(JointTrajectory(joint_names=["head_1_joint", "head_2_joint"], points=[point]))
        assert look.result(goal).status == GoalStatus.PREEMPTED


@pytest.mark.parametrize(
    "wrong", [{"frame": "nowhere"}, {"pointing_frame": "base_link"}, {"pointing_frame": "nowhere"}]
)
def test_what_cannot_be_looked_at_is_rejected(look, wrong):
    assert look.result(look(1.0, 0.0, 1.0, **wrong)).status == GoalStatus.REJECTED


def test_a_target_that_is_not_a_number_is_rejected(look):
    assert look.result(look(float("nan"), 0.0, 1.0)).status == GoalStatus.REJECTED
