"""Pages of bookings: calendar, forms, lists, policies."""
