"""Services and actions that clients advertise for other clients of the same robot, under /fleet/clients/."""
