"""Delivery of the emergency stop to bridges and watchdogs: press, deliver, keep pending, record. Doors: `teleop.stop`."""
