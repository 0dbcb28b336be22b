"""The robot's domain: who is in it, and whose bridge this robot has."""
