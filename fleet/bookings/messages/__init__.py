"""News of bookings for other programs of a person: letters by e-mail, calendar feeds."""
