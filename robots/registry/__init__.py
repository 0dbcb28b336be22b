"""Registered robots: profiles, phrases, shipped content. `robots.access` says who may see which robot."""
