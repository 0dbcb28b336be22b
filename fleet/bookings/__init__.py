"""Bookings: time on robots. The database refuses two that overlap, named rules what a lab does not allow."""
