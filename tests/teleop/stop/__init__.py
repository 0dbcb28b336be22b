"""Emergency stop from pages and programs."""
