"""Registered robots: profiles, phrases, shipped content, and who may see which robot."""
