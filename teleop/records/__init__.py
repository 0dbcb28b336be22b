"""Records that web processes write: refusals and camera viewings. Repeated events share one record."""
