"""A base without an upper body has the ROS interface that its profile states."""

from __future__ import annotations

import pytest
from geometry_msgs.msg import Twist
from sensor_msgs.msg import JointState


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", base="pmb2", seed=1)


def test_wheel_joints_are_published_and_turn(ros):
    with (
        ros.listen("/joint_states", JointState) as joints,
        ros.speak("/mobile_base_controller/cmd_vel", Twist) as command,
    ):
        before = joints.next()
        assert set(before.name) == {"wheel_left_joint", "wheel_right_joint"}
        twist = Twist()
        twist.linear.x = 0.3

        def turning(message: JointState) -> bool:
            command.publish(twist)
            return min(message.velocity) > 1.0

        after = joints.until(turning)
    assert all(later > earlier for earlier, later in zip(before.position, after.position, strict=True))
