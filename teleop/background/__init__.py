"""Database threads and background tasks, so that the event loop never waits for slow work."""
