"""Limits on the cost of a robot's network to its bridge: bytes, messages, time, connections, entries, memory, texts.

`texts` and `sizes` hold the limits. `listening` bounds what rospy reads of publishers, `doors` what it takes from those
who connect to us, `mailboxes` what reaches the event loop, `memory` the process. `board` keeps what was refused, for
the page. `install` puts all of it into rospy, in one place.
"""
