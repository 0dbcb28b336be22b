"""Pictures of the colour cameras: drawing, clock code, encoding, damage. Knows no ROS."""
