"""``python -m tests.browser.robot_side ROLE``: a program on the robot, without the console.

keys     drive the course by keys without the gate; print its duration in seconds
unknown  publish a message type that is not installed on /weather
twists   print the forward speed of each twist that the console sends, in m/s
hear     print the messages on /fleet_demo/place
faults   set the simulated robot's faults by lines of stdin ("motor_hot,part_broken")
rogue    turn the base by its controller's own topic, past the mux, whatever is cancelled
start    put the robot to its start by lines of stdin ("7.6 2.0 0.0": m, degrees); print "there" each time
person   place people in the simulated world by lines of stdin ("person 1.0 2.0"), print the robot's contacts
"""

from __future__ import annotations

import robots.bridge.ros  # noqa: F401  (first: makes rospy importable)

# isort: split
import math
import sys
import threading
import time

import genpy.dynamic
import rospy
from geometry_msgs.msg import Pose2D, PoseStamped, Twist
from nav_msgs.msg import Odometry
from std_msgs.msg import String

from robots.bridge.ros.sensors.convert import planar
from tests.browser.course import SHARE, Follower, keys

FULL_MPS, FULL_RADPS = 1.0, 2.0944
PERIOD_S = 0.05
STEP_M, STEP_RAD = 0.2, 0.3  # as near counts as there: a robot that jumps remembers obstacles at wrong places


def drive_by_keys() -> None:
    """Drive like a person with a keyboard at the robot."""
    newest: list[Odometry] = []
    rospy.Subscriber("/mobile_base_controller/odom", Odometry, lambda message: newest.append(message))
    publisher = rospy.Publisher("/key_vel", Twist, queue_size=1)
    while not (newest and publisher.get_num_connections()):
        time.sleep(0.01)
    follower = Follower()
    began_s = time.monotonic()
    while not follower.arrived:
        pose, _ = planar(newest[-1])
        forward, turn = keys(*follower.stick(pose.x, pose.y, pose.yaw))
        twist = Twist()
        twist.linear.x, twist.angular.z = forward * SHARE * FULL_MPS, turn * SHARE * FULL_RADPS
        publisher.publish(twist)
        time.sleep(PERIOD_S)
    print(f"{time.monotonic() - began_s:.2f}", flush=True)


def go_back_to_start() -> None:
    """Put the robot where each line of stdin says, unless it stands there."""
    publisher = rospy.Publisher("/ground_truth/teleport", Pose2D, queue_size=1)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    for line in sys.stdin:
        x, y, degrees = map(float, line.split())
        pose, _ = planar(rospy.wait_for_message("/ground_truth/pose", Odometry))
        turned = math.remainder(pose.yaw - math.radians(degrees), math.tau)
        if math.dist((pose.x, pose.y), (x, y)) > STEP_M or abs(turned) > STEP_RAD:
            publisher.publish(Pose2D(x, y, math.radians(degrees)))
        print("there", flush=True)


def be_the_world() -> None:
    """Place people by lines of stdin; print contacts."""
    rospy.Subscriber("/ground_truth/contacts", String, lambda message: print(message.data, flush=True))
    publisher = rospy.Publisher("/ground_truth/person", String, queue_size=5)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    for line in sys.stdin:
        publisher.publish(String(line.strip()))


def turn_past_the_mux() -> None:
    """Turn the base, as a navigation that ignores cancels and zeros."""
    publisher, twist = rospy.Publisher("/mobile_base_controller/cmd_vel", Twist, queue_size=1), Twist()
    twist.angular.z = 0.4
    pace = rospy.Rate(100)
    while not rospy.is_shutdown():
        publisher.publish(twist)
        pace.sleep()


def publish_unknown() -> None:
    """Publish a message of a package that the console lacks."""
    text = "uint8 SUN=0\nuint8 RAIN=1\nuint8 sky\nfloat32 celsius\nstring words\n"
    weather = genpy.dynamic.generate_dynamic("fleet_test_msgs/Weather", text)["fleet_test_msgs/Weather"]
    publisher = rospy.Publisher("/weather", weather, queue_size=1)
    pace = rospy.Rate(10)  # with a sleep of 0.1 s, the rate would be below 10 Hz
    while not rospy.is_shutdown():
        publisher.publish(weather(sky=1, celsius=7.5, words="Take a coat."))
        pace.sleep()


def hear_places() -> None:
    """Print places that people publish."""

    def heard(message: PoseStamped) -> None:
        position = message.pose.position
        print(f"{message.header.frame_id} {position.x:g} {position.y:g}", flush=True)

    rospy.Subscriber("/fleet_demo/place", PoseStamped, heard)
    print("listening", flush=True)
    rospy.spin()


def hear_twists() -> None:
    """Print the forward speed of each twist that the console sends."""
    rospy.Subscriber("/key_vel", Twist, lambda twist: print(f"{twist.linear.x:g}", flush=True))
    print("listening", flush=True)
    rospy.spin()


def set_faults() -> None:
    """Pass on lines of stdin as faults."""
    publisher = rospy.Publisher("/ground_truth/fault", String, queue_size=5)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    for line in sys.stdin:
        publisher.publish(String(line.strip()))


if __name__ == "__main__":
    rospy.init_node(f"usability_{sys.argv[1]}", anonymous=True, disable_signals=True)
    threading.Thread(target=rospy.spin, daemon=True).start()
    roles = {
        "keys": drive_by_keys,
        "start": go_back_to_start,
        "person": be_the_world,
        "rogue": turn_past_the_mux,
        "unknown": publish_unknown,
        "hear": hear_places,
        "twists": hear_twists,
        "faults": set_faults,
    }
    roles[sys.argv[1]]()
    rospy.signal_shutdown("done")
