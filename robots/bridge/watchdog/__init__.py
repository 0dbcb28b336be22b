"""The watchdog: a small process for each bridge. It hears stops, and repeats zeros while the bridge cannot.

It subscribes to nothing on the robot, so that no sensor can block it. The bridge sends it a heartbeat with each tick.
"""
