"""The health that the robot reports: parts, temperatures, battery. Nothing here decides about motion."""
