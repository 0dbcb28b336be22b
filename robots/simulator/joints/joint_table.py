"""TIAGo's joints above the base: names, limits, speeds, and the pose of the head's camera. Metres, radians."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Joint(NamedTuple):
    """One joint: the controller that moves it, its limits and its speed."""

    controller: str
    low: float
    high: float
    speed: float


_ARM_SPEED = 1.0
JOINTS: Mapping[str, Joint] = {
    "torso_lift_joint": Joint("torso_controller", 0.0, 0.35, 0.07),
    "arm_1_joint": Joint("arm_controller", 0.0, 2.75, _ARM_SPEED),
    "arm_2_joint": Joint("arm_controller", -1.57, 1.09, _ARM_SPEED),
    "arm_3_joint": Joint("arm_controller", -3.53, 1.57, _ARM_SPEED),
    "arm_4_joint": Joint("arm_controller", -0.39, 2.36, _ARM_SPEED),
    "arm_5_joint": Joint("arm_controller", -2.09, 2.09, _ARM_SPEED),
    "arm_6_joint": Joint("arm_controller", -1.41, 1.41, _ARM_SPEED),
    "arm_7_joint": Joint("arm_controller", -2.09, 2.09, _ARM_SPEED),
    "gripper_left_finger_joint": Joint("gripper_controller", 0.0, 0.045, 0.05),
    "gripper_right_finger_joint": Joint("gripper_controller", 0.0, 0.045, 0.05),
    "head_1_joint": Joint("head_controller", math.radians(-75), math.radians(75), 3.0),
    "head_2_joint": Joint("head_controller", math.radians(-60), math.radians(45), 3.0),
}

HOME: Mapping[str, float] = {
    "torso_lift_joint": 0.15,
    "arm_1_joint": 0.20,
    "arm_2_joint": -1.34,
    "arm_3_joint": -0.20,
    "arm_4_joint": 1.94,
    "arm_5_joint": -1.57,
    "arm_6_joint": 1.37,
    "arm_7_joint": 0.0,
    "gripper_left_finger_joint": 0.02,
    "gripper_right_finger_joint": 0.02,
    "head_1_joint": 0.0,
    "head_2_joint": 0.0,
}

# Origins of the movable links in the parent's frame. Together they place the camera 1.067 m above the
# floor at torso 0.
TORSO_M = (-0.062, 0.0, 0.790)
HEAD_PAN_M = (0.182, 0.0, 0.0)
HEAD_TILT_M = (0.005, 0.0, 0.098)
CAMERA_M = (0.050, 0.0, 0.179)


class CameraPose(NamedTuple):
    """Origin (3,) in the base frame, and the camera's axes forward, left, up as columns (3, 3)."""

    origin: NDArray[np.float64]
    axes: NDArray[np.float64]


def camera_pose(joints: Mapping[str, float]) -> CameraPose:
    """Return the pose of the head's camera at these joint positions. A positive tilt looks up."""
    pan = _about_z(joints["head_1_joint"])
    tilted = pan @ _about_y(-joints["head_2_joint"])
    lift = np.array([0.0, 0.0, joints["torso_lift_joint"]])
    origin = np.array(TORSO_M) + lift + np.array(HEAD_PAN_M) + pan @ np.array(HEAD_TILT_M)
    return CameraPose(origin + tilted @ np.array(CAMERA_M), tilted)


def _about_z(angle: float) -> NDArray[np.float64]:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _about_y(angle: float) -> NDArray[np.float64]:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
