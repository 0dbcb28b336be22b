"""``python -m robots.bridge.ros2.inspector``: the inspector of a robot with ROS 2."""

from robots.bridge.ros2.inspector.side import Ros2
from robots.bridge.topics.inspector.process import run

if __name__ == "__main__":
    run(Ros2)
