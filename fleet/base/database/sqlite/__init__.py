"""The database engine for SQLite: Django's, with turns of writers."""
