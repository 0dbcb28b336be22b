"""Changes of several bookings: waiting list, lost rights."""
