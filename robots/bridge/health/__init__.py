"""The robot's health as it reports it: parts, temperatures, battery. Nothing here decides about motion."""
