"""Processes beside the bridge that serve web processes themselves: camera process and tap.

No byte of theirs passes the bridge.
"""
