"""Webhooks: addresses, events, delivery, pages."""
