"""A profile names the actions of gripper and torso."""

from __future__ import annotations

import pytest

from robots.registry.configuration.profile_schema import topic_problems
from robots.shared.configuration.bridge_config import (
    GRIPPER_COMMAND,
    GRIPPER_COMMAND_2,
    TRAJECTORY,
    TRAJECTORY_2,
    ArmSource,
    LimbSource,
    Topic,
    Topics,
)

DRIVE, ODOMETRY = Topic("/cmd_vel", "geometry_msgs/Twist"), Topic("/odom", "nav_msgs/Odometry")


def problems(limb: str = "gripper", **said: object) -> list[str]:
    """Return the problems of a limb that has these fields in addition."""
    source = LimbSource("/gripper/action", ["left", "right"], (0.0, 0.05), 0.05, **said)  # type: ignore[arg-type]
    topics = Topics(
        DRIVE,
        ODOMETRY,
        arm=ArmSource({"shoulder": 0.0}, ["upper", "lower"]),
        joint_states=Topic("/joint_states", "sensor_msgs/JointState"),
        **{limb: source},  # type: ignore[arg-type]
    )
    return list(topic_problems(topics))


@pytest.mark.parametrize(
    "said",
    [{}, {"type": TRAJECTORY}, *({"type": GRIPPER_COMMAND, "effort_n": effort} for effort in (0.0, 30.0))],
)
def test_a_gripper_has_a_trajectory_or_a_command_with_an_effort(said: dict[str, object]) -> None:
    assert problems(**said) == []


def test_the_same_holds_for_the_types_of_ros_2() -> None:
    def wrong(limb: str, kind: str, **said: float) -> list[str]:
        source = LimbSource("/a", ["left"], (0.0, 0.05), 0.05, kind, **said)
        drive, odometry = (
            Topic("/key_vel", "geometry_msgs/msg/Twist"),
            Topic("/odom", "nav_msgs/msg/Odometry"),
        )
        joints = Topic("/joint_states", "sensor_msgs/msg/JointState")
        return list(topic_problems(Topics(drive, odometry, joint_states=joints, **{limb: source}), 2))  # type: ignore[arg-type]

    assert wrong("gripper", GRIPPER_COMMAND_2, effort_n=30.0) == wrong("gripper", TRAJECTORY_2) == []
    assert wrong("gripper", GRIPPER_COMMAND_2)[0].startswith("gripper.effort_n: ")
    assert wrong("gripper", GRIPPER_COMMAND, effort_n=30.0)[0].startswith("gripper.type: ")
    assert wrong("torso", GRIPPER_COMMAND_2, effort_n=30.0)[0].startswith("torso.type: ")


@pytest.mark.parametrize("limb", ["gripper", "torso"])
def test_a_limb_needs_joint_states_and_no_arm(limb: str) -> None:
    source = LimbSource("/limb/action", ["lift"], (0.0, 0.35), 0.05)
    joints = Topic("/joint_states", "sensor_msgs/JointState")
    assert list(topic_problems(Topics(DRIVE, ODOMETRY, joint_states=joints, **{limb: source}))) == []  # type: ignore[arg-type]
    [problem] = topic_problems(Topics(DRIVE, ODOMETRY, **{limb: source}))  # type: ignore[arg-type]
    assert problem == f"{limb}: needs joint_states, from which its position is known"


@pytest.mark.parametrize(
    ("said", "where"),
    [
        ({"type": "std_msgs/String"}, "gripper.type"),
        ({"type": GRIPPER_COMMAND}, "gripper.effort_n"),
        ({"effort_n": 30.0}, "gripper.effort_n"),
        ({"type": GRIPPER_COMMAND, "effort_n": -1.0}, "gripper.effort_n"),
        ({"type": GRIPPER_COMMAND, "effort_n": float("nan")}, "gripper.effort_n"),
        ({"limb": "torso", "type": GRIPPER_COMMAND, "effort_n": 30.0}, "torso.type"),
    ],
)
def test_the_wrong_place_is_named(said: dict[str, object], where: str) -> None:
    [problem] = problems(**said)  # type: ignore[arg-type]
    assert problem.startswith(f"{where}: ")
