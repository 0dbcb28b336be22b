"""Services and actions that clients offer to other clients of the same robot, under /fleet/clients/."""
