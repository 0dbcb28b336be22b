"""A simulated robot behind a real ROS master: MuJoCo physics, sensors with faults, PAL's interfaces."""
