"""The watchdog: a small process next to each bridge. It takes stops and repeats zeros when the bridge cannot.

It subscribes to no topic of the robot, so that no sensor can delay it. The bridge sends it a heartbeat with each tick.
"""
