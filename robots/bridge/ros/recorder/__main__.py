"""``python -m robots.bridge.ros.recorder``: the recorder of a robot with ROS 1."""

from robots.bridge.recorder.process import run
from robots.bridge.ros.recorder.recorded_topics import joined

if __name__ == "__main__":
    run(joined)
