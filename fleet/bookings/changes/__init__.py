"""Changes of several bookings: series, waiting list, policies, lost rights.

For single changes: `services`.
"""
