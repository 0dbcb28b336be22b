"""Limits the load of a robot's network on its bridge: bytes, messages, time, connections, memory, texts.

`texts` and `sizes` contain the limits. `listening` limits rospy's reading from publishers, `servers` the
nodes that connect to us, `mailboxes` the calls on the event loop, `memory` the process. `board` keeps for the
page why data was refused. `install` replaces parts of rospy by these, in one place.
"""
