"""Changes of several bookings: series, waiting list, policies, holidays, hand-overs.

For single changes: `services`.
"""
