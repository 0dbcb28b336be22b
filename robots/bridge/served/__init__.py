"""Processes beside the bridge that serve web processes themselves: camera process, tap and shelf.

No byte of theirs passes the bridge.
"""
