"""Delivers the emergency stop to bridges and watchdogs; repeats and records it. See also `teleop.stop`."""
