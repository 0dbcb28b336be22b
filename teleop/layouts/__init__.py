"""Layouts of a robot's control page that supervisors share with everybody who sees the robot."""
