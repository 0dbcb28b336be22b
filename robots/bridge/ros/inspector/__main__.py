"""``python -m robots.bridge.ros.inspector``: the inspector of a robot with ROS 1."""

from robots.bridge.ros.inspector.side import Ros1
from robots.bridge.topics.inspector.process import run

if __name__ == "__main__":
    run(Ros1)
