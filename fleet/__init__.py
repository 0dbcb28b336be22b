"""The Django project: settings and parts that every page needs."""
