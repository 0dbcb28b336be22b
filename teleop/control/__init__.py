"""Who may control a robot: rules, policy, lease services and queries. Knows no socket."""
