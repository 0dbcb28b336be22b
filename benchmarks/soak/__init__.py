"""script/soak: parts of a running console are killed while somebody drives; its log is compared with the robot."""
