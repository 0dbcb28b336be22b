"""The joint trajectory controllers move the joints of /joint_states, with real ROS messages."""

from __future__ import annotations

import itertools
from contextlib import contextmanager

import pytest
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from sensor_msgs.msg import JointState
from std_srvs.srv import Empty
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from robots.shared.ros.message_types.classes import message_class

_numbers = itertools.count()
HEAD = ("head_1_joint", "head_2_joint")
FINGERS = ("gripper_left_finger_joint", "gripper_right_finger_joint")


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


def trajectory(joints, positions, seconds: float) -> JointTrajectory:
    point = JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration.from_sec(seconds))
    return JointTrajectory(joint_names=list(joints), points=[point])


def at(joint: str, position: float):
    def there(message: JointState) -> bool:
        return abs(message.position[list(message.name).index(joint)] - position) < 0.001

    return there


@contextmanager
def following(ros, controller: str):
    """Yield three functions: ``begin(trajectory)`` returns the goal's id, ``result(id)`` waits, the third cancels."""
    action = f"/{controller}/follow_joint_trajectory"
    goal_type = message_class("control_msgs/FollowJointTrajectoryActionGoal")
    result_type = message_class("control_msgs/FollowJointTrajectoryActionResult")
    with (
        ros.listen(f"{action}/result", result_type) as results,
        ros.speak(f"{action}/goal", goal_type) as goals,
        ros.speak(f"{action}/cancel", GoalID) as cancels,
    ):
        ros.connected(results)

        def begin(wanted: JointTrajectory) -> str:
            goal = goal_type()
            goal.goal_id.id = f"test-{next(_numbers)}"
            goal.goal.trajectory = wanted
            goals.publish(goal)
            return goal.goal_id.id

        def result(goal_id: str):
            return results.until(lambda message: message.status.goal_id.id == goal_id)

        yield begin, result, cancels


@pytest.mark.parametrize(
    ("controller", "joints", "positions"),
    [
        ("head_controller", HEAD, [0.4, -0.3]),
        ("torso_controller", ["torso_lift_joint"], [0.17]),
        ("gripper_controller", FINGERS, [0.04, 0.04]),
        ("arm_controller", [f"arm_{n}_joint" for n in range(1, 8)], [0.4, -1.3, -0.2, 1.9, -1.5, 1.3, 0.1]),
    ],
)
def test_a_command_moves_the_joints(ros, controller, joints, positions):
    with (
        ros.listen("/joint_states", JointState) as states,
        ros.speak(f"/{controller}/command", JointTrajectory) as command,
    ):
        command.publish(trajectory(joints, positions, 0.2))
        states.until(lambda message: all(at(*pair)(message) for pair in zip(joints, positions, strict=True)))


def test_a_goal_is_reached_and_its_state_reported(ros):
    state_type = message_class("control_msgs/JointTrajectoryControllerState")
    with ros.listen("/head_controller/state", state_type) as states:
        with following(ros, "head_controller") as (begin, result, _):
            assert result(begin(trajectory(HEAD, [-0.3, 0.1], 0.3))).status.status == GoalStatus.SUCCEEDED
        state = states.until(lambda message: abs(message.actual.positions[0] + 0.3) < 0.001)
    assert tuple(state.joint_names) == HEAD


def test_a_goal_beyond_joint_limits_is_aborted_at_the_limit(ros):
    with (
        ros.listen("/joint_states", JointState) as states,
        following(ros, "head_controller") as (begin, result, _),
    ):
        ended = result(begin(trajectory(HEAD, [2.0, 0.0], 0.1)))
        states.until(at("head_1_joint", 1.30900))
    assert ended.status.status == GoalStatus.ABORTED
    assert ended.result.error_code == ended.result.GOAL_TOLERANCE_VIOLATED


def test_a_goal_with_a_strangers_joints_is_rejected(ros):
    with following(ros, "head_controller") as (begin, result, _):
        ended = result(begin(trajectory(["arm_1_joint"], [1.0], 0.1)))
    assert ended.status.status == GoalStatus.REJECTED
    assert ended.result.error_code == ended.result.INVALID_JOINTS


def test_a_goal_can_be_cancelled_and_replaced(ros):
    with following(ros, "head_controller") as (begin, result, cancels):
        first = begin(trajectory(HEAD, [0.5, 0.0], 30.0))
        second = begin(trajectory(HEAD, [-0.5, 0.0], 30.0))
        assert result(first).status.status == GoalStatus.PREEMPTED
        cancels.publish(GoalID(id=second))
        assert result(second).status.status == GoalStatus.PREEMPTED


def test_a_motion_waits_for_no_trajectory(ros):
    motion_goal = message_class("play_motion_msgs/PlayMotionActionGoal")
    motion_result = message_class("play_motion_msgs/PlayMotionActionResult")
    with (
        following(ros, "head_controller") as (begin, result, cancels),
        ros.listen("/play_motion/result", motion_result) as results,
        ros.speak("/play_motion/goal", motion_goal) as motions,
        ros.listen("/joint_states", JointState) as states,
    ):
        ros.connected(results)
        goal_id = begin(trajectory(HEAD, [1.0, 0.0], 30.0))
        states.until(lambda message: abs(message.velocity[list(message.name).index("head_1_joint")]) > 1e-4)
        motion = motion_goal()
        motion.goal_id.id = f"test-{next(_numbers)}"
        motion.goal.motion_name = "head_tour"
        motions.publish(motion)
        refused = results.until(lambda message: message.status.goal_id.id == motion.goal_id.id)
        cancels.publish(GoalID(id=goal_id))
        result(goal_id)
    assert refused.status.status == GoalStatus.REJECTED
    assert refused.result.error_code == refused.result.CONTROLLER_BUSY


def test_the_parallel_gripper_moves_both_fingers_by_half_the_gap(ros):
    with (
        ros.listen("/joint_states", JointState) as states,
        ros.speak("/parallel_gripper_controller/command", JointTrajectory) as command,
    ):
        command.publish(trajectory(["parallel_gripper_joint"], [0.06], 0.5))
        states.until(lambda message: all(at(finger, 0.03)(message) for finger in FINGERS))


@pytest.mark.parametrize(("service", "gap"), [("release", 0.045), ("grasp", 0.0)])
def test_grasp_and_release_answer_when_the_fingers_are_there(ros, service, gap):
    with ros.listen("/joint_states", JointState) as states:
        name = f"/parallel_gripper_controller/{service}"
        rospy.wait_for_service(name, timeout=10.0)
        rospy.ServiceProxy(name, Empty)()
        states.settle()
        assert all(at(finger, gap)(states.next()) for finger in FINGERS)
