"""The ROS network: master, nodes, host names and connections."""
