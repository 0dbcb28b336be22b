"""Benchmarks of what pages and programs ask for besides driving: API, bookings, arm, topics."""
