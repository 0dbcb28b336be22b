"""Tokens with which programs sign in. People make, list and end them.

A token is limited to scopes and robots.
"""
