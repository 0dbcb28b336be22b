"""Right to control a robot: rules, lease checks, services and queries. Uses no sockets."""
