"""Numbers a robot's runs by its odometry connections: a restarted robot keeps its name and address."""

from __future__ import annotations

from collections import deque

KNOWN = 4  # newest connections kept: two nodes that publish in turn must not count as new each time


class RunMonitor:
    """Numbers the runs. `start_run` and `of` may be called on different threads."""

    def __init__(self) -> None:
        self._number = 0
        self._headers: deque[object] = deque(maxlen=KNOWN)

    def start_run(self) -> None:
        """Start a new run: the robot's master was restarted."""
        self._number += 1

    def of(self, header: object) -> int:
        """Return the run of a message with this connection header. rospy makes one header object per connection."""
        if not any(header is known for known in self._headers):
            self._headers.append(header)
            self._number += 1
        return self._number
