"""TIAGo's joints above the base: names, limits, speeds, and the places of torso, head and camera. Metres, radians."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple


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
