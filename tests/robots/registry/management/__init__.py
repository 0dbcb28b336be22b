"""Commands of manage.py: replay and demo content."""
