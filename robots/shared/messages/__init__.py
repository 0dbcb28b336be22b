"""Values of ROS messages as JSON fields and packed bytes."""
