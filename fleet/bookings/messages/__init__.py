"""Notifications of bookings, on pages and by e-mail, and calendar feeds for other programs of a person."""
