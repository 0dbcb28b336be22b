"""The emergency stop and its clear, for pages, forms and programs. `robots.link` delivers stops to the robots."""
