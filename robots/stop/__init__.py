"""Delivery of the emergency stop to bridges and watchdogs: press, deliver, repeat, record. Doors: `teleop.stop`."""
