"""Recordings that go on: who may begin and end them, those of bookings, and what ends them early."""
