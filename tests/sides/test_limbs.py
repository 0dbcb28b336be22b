"""Gripper and torso of a simulated TIAGo, moved through a real bridge."""

from __future__ import annotations

import itertools

import pytest

from robots.bridge.limbs.limb_move import THERE_M
from robots.shared import wire
from tests.processes import until
from tests.ros.bridge_support import drivable

PARTS = ("gripper", "torso", "joint_states", "motions")
TRIES = 3  # on a busy computer, a scan that comes late ends a motion
_numbers = itertools.count(1)


class Holder:
    """The holder of control, who moves the robot's limbs."""

    def __init__(self, bridge, hand) -> None:
        self.bridge, self.hand = bridge, hand
        hand.state_until(drivable, "a robot that can be driven")
        hand.state_until(lambda state: state.limbs["gripper"].at_m is not None, "joint states")
        hand.take_control(1)
        hand.let_go()

    def asks(self, limb: str, to_m: float) -> wire.Refusal | None:
        return self.hand.ask(wire.MoveLimb(1, limb, to_m, next(_numbers)))

    def moves(self, limb: str, to_m: float) -> wire.LimbEnd:
        """Ask for a move, and wait until the move ends."""
        assert self.asks(limb, to_m) is None
        return self.ended(limb)

    def ended(self, limb: str) -> wire.LimbEnd:
        state = self.until(
            lambda state: state.limbs[limb].to_m is None and state.limbs[limb].ended, f"the end of the {limb}"
        )
        return state.limbs[limb].ended

    def plays(self, motion: str) -> None:
        """Play a motion, as soon as the bridge knows the arm, and wait until it ends."""
        for _ in range(TRIES):
            until(lambda: self.hand.ask(wire.Play(1, motion, next(_numbers))) is None, f"{motion} begun")
            over = self.until(
                lambda state: state.motion is None and state.motion_ended, "the end of the motion"
            )
            if over.motion_ended.outcome != "not_watched":
                return

    def until(self, condition, what: str) -> wire.State:
        return self.hand.state_until(condition, what)


@pytest.fixture
def config(side, tmp_path, request):
    return side.config(tmp_path, *PARTS, *getattr(request, "param", ["arm"]))


@pytest.fixture
def holder(bridge):
    hand = bridge.link()
    yield Holder(bridge, hand)
    hand.close()


def test_the_gripper_opens_and_closes(holder):
    end = holder.moves("gripper", 0.09)
    assert (end.outcome, end.at_m) == ("done", pytest.approx(0.09, abs=THERE_M))
    assert holder.moves("gripper", 0.0).outcome == "done"
    assert holder.hand.state.limbs["gripper"].at_m < THERE_M
    assert holder.moves("gripper", 0.03).at_m == pytest.approx(0.03, abs=THERE_M)
    until(lambda: "limb.end done" in holder.bridge.recorded(), "the end on record")
    kinds = [line.split()[0] for line in holder.bridge.recorded()]
    assert kinds.index("limb.start") < kinds.index("limb.end")


def test_the_torso_rises_and_a_stop_holds_it(holder):
    assert holder.asks("torso", 0.35) is None
    holder.until(lambda state: state.limbs["torso"].at_m > 0.2, "a torso that rises")
    holder.hand.send(wire.LinkStop("Bob", "enough", seq=7))
    end = holder.ended("torso")
    assert end.outcome == "stopped" and 0.2 < end.at_m < 0.3
    assert holder.asks("torso", 0.1).code == "stopped"


@pytest.mark.parametrize("config", [()], indirect=True)
def test_limbs_of_a_robot_without_an_arm_move(holder):
    assert holder.moves("gripper", 0.04).outcome == "done"
    assert holder.moves("torso", 0.2).outcome == "done"


def test_the_arm_must_be_at_home_for_the_torso(holder):
    holder.plays("offer")
    assert holder.asks("torso", 0.2).code == "arm_away"
    assert holder.moves("gripper", 0.05).outcome == "done"
    holder.plays("home")
    holder.until(lambda state: not state.arm, "joint states of it")
    assert holder.moves("torso", 0.15).outcome == "done"


def test_joints_that_do_not_move_are_told(holder, fault):
    fault("joints_stuck")
    at_m = holder.hand.state.limbs["torso"].at_m
    end = holder.moves("torso", 0.30 if at_m < 0.2 else 0.0)
    assert end.outcome in {"no_progress", "failed"} and end.text


def test_a_controller_that_never_answers_is_given_up(holder, fault):
    fault("controllers_silent")
    end = holder.moves("gripper", 0.09 if holder.hand.state.limbs["gripper"].at_m < 0.05 else 0.0)
    # With ROS 1 the goal stays pending, and the fingers do not move; with ROS 2 nobody answers to it.
    assert end.outcome in {"no_progress", "unheard"}
    # The base waits until the controller no longer reports the goal.
    until(lambda: holder.hand.ask(wire.DriveBy(1, distance_m=0.1, seq=next(_numbers))) is None, "a drive")
