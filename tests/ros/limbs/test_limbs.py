"""Gripper and torso of a simulated TIAGo, moved through a real bridge."""

from __future__ import annotations

import pytest
from msgspec import structs

from robots.bridge.limbs.limb_move import THERE_M
from robots.shared import wire
from robots.shared.configuration.bridge_config import GRIPPER_COMMAND, ArmSource, LimbSource, Topic
from tests.processes import until
from tests.ros.bridge_support import drivable, running_bridge, tiago_config
from tests.ros.performing import numbers

FINGERS = ["gripper_left_finger_joint", "gripper_right_finger_joint"]
TOPICS = {
    "gripper": LimbSource("/gripper_controller/follow_joint_trajectory", FINGERS, (0.0, 0.045), 0.05),
    "torso": LimbSource("/torso_controller/follow_joint_trajectory", ["torso_lift_joint"], (0.0, 0.35), 0.07),
    "joint_states": Topic("/joint_states", "sensor_msgs/JointState"),
    "arm": ArmSource(
        home={
            "arm_1_joint": 0.20,
            "arm_2_joint": -1.34,
            "arm_3_joint": -0.20,
            "arm_4_joint": 1.94,
            "arm_5_joint": -1.57,
            "arm_6_joint": 1.37,
            "arm_7_joint": 0.0,
        },
        links=[*(f"arm_{number}_link" for number in range(1, 8)), "gripper_grasping_frame"],
    ),
    "motions": Topic("/play_motion", "play_motion_msgs/PlayMotionAction"),
}
COMMANDED = {
    "gripper": structs.replace(
        TOPICS["gripper"], action="/gripper_controller/gripper_action", type=GRIPPER_COMMAND, effort_n=30.0
    )
}


class Holder:
    """The holder of control, who moves the robot's limbs."""

    def __init__(self, process, hand) -> None:
        self.process, self.hand = process, hand

    def asks(self, limb: str, to_m: float) -> wire.Refusal | None:
        return self.hand.ask(wire.MoveLimb(1, limb, to_m, next(numbers)))

    def moves(self, limb: str, to_m: float) -> wire.LimbEnd:
        """Ask for a move, and wait until the move ends."""
        assert self.asks(limb, to_m) is None
        return self.ended(limb)

    def ended(self, limb: str) -> wire.LimbEnd:
        state = self.hand.state_until(
            lambda state: state.limbs[limb].to_m is None and state.limbs[limb].ended, f"the end of the {limb}"
        )
        return state.limbs[limb].ended

    def until(self, condition, what: str) -> wire.State:
        return self.hand.state_until(condition, what)


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1)


@pytest.fixture
def holder(rosmaster, robot, tmp_path, request):
    topics = TOPICS | getattr(request, "param", {})
    with running_bridge(tiago_config(rosmaster, tmp_path, topics=topics), rosmaster, tmp_path) as (
        process,
        hand,
    ):
        hand.state_until(drivable, "a robot that can be driven")
        hand.state_until(lambda state: state.limbs["gripper"].at_m is not None, "joint states")
        hand.take_control(1)
        hand.let_go()
        yield Holder(process, hand)


@pytest.mark.parametrize("holder", [COMMANDED], indirect=True)
def test_a_gripper_of_its_own_controller_moves_stalls_and_stops(holder, fault):
    far, near = (0.09, 0.0) if holder.hand.state.limbs["gripper"].at_m < 0.05 else (0.0, 0.09)
    end = holder.moves("gripper", far)
    assert (end.outcome, end.at_m) == ("done", pytest.approx(far, abs=THERE_M))
    until(lambda: "limb.end done" in holder.process.recorded(), "the end on record")
    kinds = [line.split()[0] for line in holder.process.recorded()]
    assert kinds.index("limb.start") < kinds.index("limb.end")
    fault("joints_stuck")
    end = holder.moves("gripper", near)
    assert (end.outcome, end.at_m) == ("stalled", pytest.approx(far, abs=THERE_M))
    assert "Perhaps it holds something" in end.text
    assert holder.hand.ask(wire.DriveBy(1, distance_m=0.1, seq=next(numbers))) is None
    holder.until(lambda state: state.drive_by_ended, "the end of the drive")
    fault("controllers_silent")
    assert holder.asks("gripper", near) is None
    holder.hand.send(wire.LinkStop("Bob", "enough", seq=7))
    assert holder.ended("gripper").outcome == "stopped"
