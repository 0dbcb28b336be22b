"""Pictures of the cameras on the control page."""
