"""A sonar that detects the robot itself blocks reverse. The robot's page names the sonar and the remedy."""

from __future__ import annotations

import threading

import pytest
import rospy
from msgspec import structs
from sensor_msgs.msg import Range
from std_msgs.msg import Header

from tests.processes import until
from tests.ros.bridge_support import SONARS, drivable, running_bridge, tiago_config

SKIRT = "skirt_sonar_link"  # a fourth sonar, which the simulated robot lacks


@pytest.fixture
def skirt(ros):
    """A sonar at the back that reports 0.05 m all the time."""
    publisher = rospy.Publisher("/sonar_base", Range, queue_size=1)
    ending = threading.Event()

    def publish():
        while not ending.wait(0.1):
            header = Header(stamp=rospy.Time.now(), frame_id=SKIRT)
            publisher.publish(Range(header=header, range=0.05, min_range=0.02, max_range=1.0))

    thread = threading.Thread(target=publish)
    thread.start()
    yield
    ending.set()
    thread.join()
    publisher.unregister()


def test_an_own_echo_is_named_in_the_state_and_in_the_verdict(rosmaster, simulator, skirt, tmp_path):
    simulator(pose="3.8,2.2,0", seed=1)
    config = tiago_config(rosmaster, tmp_path, gate={"has_depth": False})
    first = config.topics.sonars[0]
    topics = structs.replace(
        config.topics,
        sonars=[
            *config.topics.sonars,
            structs.replace(first, frame_id=SKIRT, pose=SONARS["base_sonar_02_link"]),
        ],
    )
    gate = structs.replace(
        config.gate,
        sonar_poses=config.gate.sonar_poses | {SKIRT: SONARS["base_sonar_02_link"]},
        sonar_fov=config.gate.sonar_fov | {SKIRT: 0.5},
    )
    config = structs.replace(config, topics=topics, gate=gate)
    why = f"{SKIRT} reports 0.05 m wherever the robot goes: clean it"
    with running_bridge(config, rosmaster, tmp_path) as (_, hand):
        hand.state_until(drivable, "a robot that sees")
        hand.take_control(1)
        hand.drive_until(
            0.5, lambda state: any(not s.ok and why in s.text for s in state.sensors), "a named sonar"
        )
        hand.stick(0.0)
        until(lambda: not hand.state.neutral_needed, "a stick in the middle")
        state = hand.drive_until(-0.5, lambda state: why in state.verdict.text, "its name in the verdict")
        assert state.verdict.text.startswith("stopped")
