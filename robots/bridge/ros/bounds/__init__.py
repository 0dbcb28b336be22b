"""Limits on the cost of a robot's network to its bridge: bytes, messages, time, connections, entries, memory, texts.

`texts` and `sizes` hold the limits. `listening` bounds rospy's reading from publishers, `servers` the nodes
that connect to us, `mailboxes` the calls on the event loop, `memory` the process. `board` keeps reasons of refused
data for the page. `install` replaces rospy's parts by these, in one place.
"""
