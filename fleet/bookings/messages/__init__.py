"""Notifications of bookings, on pages and by e-mail, and calendar feeds for a person's calendar programs."""
