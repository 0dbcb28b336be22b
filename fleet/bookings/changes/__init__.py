"""Changes of several bookings: series, waiting list, policies, lost rights. `services` makes each single change."""
