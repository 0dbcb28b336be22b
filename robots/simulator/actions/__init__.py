"""The simulated robot's action servers, whichever ROS carries them: speech, motions, navigation, joint controllers."""
