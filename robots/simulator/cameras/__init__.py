"""Pictures of the colour cameras: drawing, clock code, encoding, damage. Without ROS."""
