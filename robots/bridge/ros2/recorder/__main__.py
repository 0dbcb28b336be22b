"""``python -m robots.bridge.ros2.recorder``: the recorder of a robot with ROS 2."""

from robots.bridge.recorder.process import run
from robots.bridge.ros2.recorder.recorded_topics import joined

if __name__ == "__main__":
    run(joined)
