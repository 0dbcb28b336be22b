"""The emergency stop and its clear, for pages, forms and programs. `robots.stop` delivers stops to the robots."""
