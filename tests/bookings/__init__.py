"""Slots: rules, services, pages, courses, policies, series, races."""
