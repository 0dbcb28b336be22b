"""Bookings that several people share: their members, and the line of people who take turns."""
