"""The fields of a profile about navigation, and their errors."""

import pytest

from robots.registry.configuration.profile_schema import topic_problems
from robots.shared.configuration.bridge_config import NavigationSource, Topic, Topics

DRIVE, ODOMETRY = Topic("/key_vel", "geometry_msgs/Twist"), Topic("/odom", "nav_msgs/Odometry")
MAP = Topic("/map", "nav_msgs/OccupancyGrid")


def problems(map_topic=MAP, **changes):
    said = {"action": "/move_base", "velocity": "/nav_vel", "pose": "/amcl_pose", **changes}
    topics = Topics(DRIVE, ODOMETRY, map=map_topic, navigation=NavigationSource(**said))
    return list(topic_problems(topics)), topics


def test_a_robot_may_have_no_map():
    assert not problems(map_topic=None)[0]  # goals are then refused, but a person can drive the robot


def test_a_stop_cancels_navigation_too():
    found, topics = problems()
    assert not found and topics.cancelled == ["/move_base"]


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"action": "move base"}, "navigation.action"),
        ({"plan": "plan"}, "navigation.plan"),
        ({"type": "nav2_msgs/NavigateToPose"}, "navigation.type"),
        ({"frame": "odom"}, "navigation.frame"),
    ],
)
def test_faults_name_their_place(changes, place):
    found, _ = problems(**changes)
    assert len(found) == 1 and found[0].startswith(place)
