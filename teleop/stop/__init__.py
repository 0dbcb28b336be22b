"""Doors of the emergency stop and the clear: pages, forms, programs. `robots.stop` delivers them to the robots."""
