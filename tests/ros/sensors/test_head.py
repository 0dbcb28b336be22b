"""The head of a TIAGo with and without its action."""

from __future__ import annotations

import pytest
from actionlib_msgs.msg import GoalID
from msgspec.structs import replace
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from robots.shared import wire
from robots.shared.ros.message_types.classes import message_class
from tests.ros.bridge_support import drivable, running_bridge
from tests.sides.side import Ros1Side


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(seed=1)


def position_of(state: JointState, joint: str) -> float:
    return state.position[list(state.name).index(joint)]


@pytest.mark.parametrize("is_offered", [True, False], ids=("action", "controller"))
def test_the_head_is_turned_by_its_action_where_offered(is_offered, ros, rosmaster, tmp_path):
    action = "/head_controller/point_head_action" if is_offered else "/no_such_action"
    side = Ros1Side(rosmaster)
    head = replace(side.topics.head, point_head=action)
    config = side.config(tmp_path, "depth", topics={"head": head})
    with (
        running_bridge(config, side, tmp_path) as (_, hand),
        ros.listen(f"{action}/goal", message_class("control_msgs/PointHeadActionGoal")) as goals,
        ros.listen(f"{action}/cancel", GoalID) as cancels,
        ros.listen(head.topic, JointTrajectory) as trajectories,
        ros.listen("/joint_states", JointState) as joints,
    ):

        def looks(pan: float, tilt: float) -> None:
            stays = 0  # messages: on its way down and up again, the head passes many places

            def is_there(state: JointState) -> bool:
                nonlocal stays
                off = (position_of(state, head.pan_joint) - pan, position_of(state, head.tilt_joint) - tilt)
                stays = stays + 1 if max(map(abs, off)) < 0.01 else 0
                return stays > 10

            joints.until(is_there)

        hand.state_until(drivable, "a robot that can be driven")
        hand.take_control(1)
        hand.send(wire.LookAhead(1))
        looks(0.0, head.look_tilt)
        hand.send(wire.TurnHead(1, 0.5, 0.3))
        looks(0.5, head.look_tilt + 0.3)
        outcome = "done" if is_offered else "sent"  # this bridge reads no joint states
        hand.state_until(lambda state: state.head_ended and state.head_ended.outcome == outcome, outcome)
        used, unused = (goals, trajectories) if is_offered else (trajectories, goals)
        assert used.drain()
        assert not unused.drain()
        hand.send(wire.LinkStop("Bob"))
        assert cancels.next().id == "", "all goals of the action"
