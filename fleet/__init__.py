"""The Django project: settings and what every page needs."""
