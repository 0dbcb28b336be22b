"""The simulated robot drives like a TIAGo, as seen from another node."""

from __future__ import annotations

import json
import math

import pytest
import rospy
from geometry_msgs.msg import Pose2D, Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool, String

COMMANDS = "/mobile_base_controller/cmd_vel"
ODOMETRY = "/mobile_base_controller/odom"


@pytest.fixture(scope="module", autouse=True)
def robot(ros, simulator):
    return simulator(pose="2,1.8,0", seed=1, drift=0)


@pytest.fixture
def odometry(ros):
    """Odometry of a robot that stands at its start."""
    with (
        ros.listen(ODOMETRY, Odometry) as odometry,
        ros.listen("/ground_truth/pose", Odometry) as truth,
        ros.speak("/ground_truth/teleport", Pose2D) as teleport,
    ):
        odometry.until(stands)
        teleport.publish(Pose2D(2.0, 1.8, 0.0))
        truth.until(lambda message: math.dist((2.0, 1.8), position(message)) < 0.001)
        odometry.settle()
        yield odometry


def forward(mps: float) -> Twist:
    twist = Twist()
    twist.linear.x = mps
    return twist


def position(message: Odometry) -> tuple[float, float]:
    return message.pose.pose.position.x, message.pose.pose.position.y


def stands(message: Odometry) -> bool:
    return abs(message.twist.twist.linear.x) < 0.001


def moves(message: Odometry) -> bool:
    return message.twist.twist.linear.x > 0.1


def drive(publisher: rospy.Publisher, twist: Twist, odometry, ticks: int) -> Odometry:
    """Publish once per odometry message; return the last of these messages."""
    for _ in range(ticks):
        publisher.publish(twist)
        last = odometry.next()
    return last


def drive_until(condition, publisher: rospy.Publisher, twist: Twist, odometry, also=lambda: None) -> None:
    """Publish once per odometry message until `condition` is true."""

    def satisfied(message: Odometry) -> bool:
        publisher.publish(twist)
        also()
        return condition(message)

    odometry.until(satisfied)


def test_it_drives_on_key_vel_and_stops_by_itself(ros, odometry):
    with ros.speak("/key_vel", Twist) as keys:
        start = position(odometry.next())
        moving = drive(keys, forward(0.3), odometry, 40)
        assert moving.twist.twist.linear.x == pytest.approx(0.3, abs=0.02)
        assert math.dist(start, position(moving)) > 0.1
        stopped = odometry.until(stands, timeout_s=2.0)
    took = (stopped.header.stamp - moving.header.stamp).to_sec()
    assert 0.2 < took < 0.25 + 0.3 + 0.15, "the controller's 0.25 s, then 0.3 m/s at 1 m/s^2"


def test_odometry_names_its_frames_and_keeps_its_pace(odometry):
    messages = [odometry.next() for _ in range(51)]
    assert {(m.header.frame_id, m.child_frame_id) for m in messages} == {("odom", "base_footprint")}
    stamps = [message.header.stamp.to_sec() for message in messages]
    assert stamps == sorted(stamps)
    assert stamps[-1] - stamps[0] == pytest.approx(1.0, abs=0.2)


def test_the_mux_speaks_on_the_controllers_own_topic(ros, odometry):
    with ros.listen(COMMANDS, Twist) as commands, ros.speak("/phone_vel", Twist) as phone:
        drive(phone, forward(0.11), odometry, 5)
        assert commands.next().linear.x == pytest.approx(0.11)


def test_any_publisher_on_the_controllers_topic_bypasses_mux(ros, odometry):
    with (
        ros.speak("/emergency_brake", Bool) as brake,
        ros.speak(COMMANDS, Twist) as direct,
        ros.speak("/key_vel", Twist) as keys,
    ):
        drive_until(moves, keys, forward(0.3), odometry)
        brake.publish(Bool(True))
        drive_until(stands, keys, forward(0.3), odometry)
        drive_until(moves, direct, forward(0.2), odometry)
        brake.publish(Bool(False))


def test_the_labs_joystick_wins_over_the_keys(ros, odometry):
    with ros.speak("/joy_vel", Twist) as joystick, ros.speak("/key_vel", Twist) as keys:
        drive_until(moves, keys, forward(0.3), odometry)
        joystick.publish(forward(0.0))
        drive_until(stands, keys, forward(0.3), odometry, also=lambda: joystick.publish(forward(0.0)))
        # The joystick is silent: after 0.5 s the keys drive again.
        drive_until(moves, keys, forward(0.3), odometry)


@pytest.mark.parametrize("lock", ["pause_navigation", "joy_priority", "emergency_brake", "stop_closing_loop"])
def test_a_lock_masks_the_keys(ros, odometry, lock):
    with ros.speak(f"/{lock}", Bool) as locking, ros.speak("/key_vel", Twist) as keys:
        drive_until(moves, keys, forward(0.3), odometry)
        locking.publish(Bool(True))
        drive_until(stands, keys, forward(0.3), odometry)
        assert stands(drive(keys, forward(0.3), odometry, 15)), "for as long as the lock is on"
        locking.publish(Bool(False))
        drive_until(moves, keys, forward(0.3), odometry)


def test_not_a_number_is_ignored(ros, odometry):
    with ros.speak("/key_vel", Twist) as keys:
        drive(keys, forward(math.nan), odometry, 3)
        drive(keys, forward(math.inf), odometry, 3)
        assert drive(keys, forward(0.2), odometry, 25).twist.twist.linear.x == pytest.approx(0.2, abs=0.02)


def test_contact_with_a_wall_is_published_as_ground_truth(ros, odometry):
    with (
        ros.listen("/ground_truth/contacts", String) as contacts,
        ros.speak("/ground_truth/teleport", Pose2D) as teleport,
        ros.speak("/key_vel", Twist) as keys,
    ):
        teleport.publish(Pose2D(9.4, 2.5, 0.0))
        odometry.settle()
        contacts.drain()
        drive(keys, forward(0.3), odometry, 60)
        entries = [json.loads(message.data) for message in contacts.drain()]
    touched = [entry for entry in entries if entry["contacts"]]
    assert {contact["with"] for entry in touched for contact in entry["contacts"]} == {"east wall"}
    assert touched[0]["speed_mps"] == pytest.approx(0.3, abs=0.05)
