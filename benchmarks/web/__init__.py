"""Benchmarks of the requests of pages and programs except driving: API, bookings, arm, topics."""
