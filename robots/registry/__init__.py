"""Registered robots: profiles, phrases, shipped content. `robots.access` decides who may see which robot."""
