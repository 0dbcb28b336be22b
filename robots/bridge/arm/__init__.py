"""The arm: its posture by the robot’s description, and its room for a motion."""
