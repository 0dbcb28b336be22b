"""The watchdog: a small process beside each bridge that hears stops, and repeats zeros when the bridge cannot.

It subscribes to nothing on the robot, so that no sensor can hold it up. The bridge sends it a beat with each tick.
"""
