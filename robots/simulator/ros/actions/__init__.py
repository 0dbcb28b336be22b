"""The simulated robot's action servers: speech, motions, and the controllers of head, torso, arm and gripper."""
