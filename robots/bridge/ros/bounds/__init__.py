"""Limits the load of a robot's network on its bridge: bytes, messages, time, connections, memory, texts.

`sizes` contains the limits. `listening` limits rospy's reading from publishers, `servers` the nodes that connect
to us. `install` replaces parts of rospy by these, in one place. In `robots/bridge/robot/`, `mailboxes` limits the
calls on the event loop, and `board` keeps for the page why data was refused.
"""
