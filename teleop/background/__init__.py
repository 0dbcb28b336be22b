"""Work off the event loop's critical path: database threads and background tasks."""
