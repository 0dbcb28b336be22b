"""Right to control a robot: rules, policy, lease services and queries. Uses no sockets."""
