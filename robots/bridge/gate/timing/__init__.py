"""Delays and ages: latency, acknowledgements, freshness, and the trail of poses."""
