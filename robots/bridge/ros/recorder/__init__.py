"""The recorder of a ROS 1 robot: subscribes to the topics of its black box and of a recording."""
