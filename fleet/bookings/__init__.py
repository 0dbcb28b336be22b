"""Bookings: time on robots. The database refuses bookings that overlap; `rules` has the rules of the lab."""
