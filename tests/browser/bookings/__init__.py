"""Bookings, slots and courses."""
