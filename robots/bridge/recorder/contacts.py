"""Recognises the messages by which robots report that they touch something. Pure."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

_LENGTH = struct.Struct("<I")
_NAMED = re.compile(r"bump|contact|collision", re.IGNORECASE)
AGAIN_S = 5.0  # a contact that ends and comes back sooner is the same one


def _behind_header(data: bytes) -> int:
    """Return where the fields after a std_msgs/Header begin."""
    return 16 + int(_LENGTH.unpack_from(data, 12)[0])


def _bumper_pressed(data: bytes) -> bool:
    at = _behind_header(data)
    return any(data[at : at + 2])  # left, right


# Whether a message of this type reports a contact
_TOUCHES: dict[str, Callable[[bytes], bool]] = {
    "kobuki_msgs/BumperEvent": lambda data: data[1] == 1,  # bumper, state
    "create_msgs/Bumper": _bumper_pressed,
    "ca_msgs/Bumper": _bumper_pressed,
    "gazebo_msgs/ContactsState": lambda data: _LENGTH.unpack_from(data, _behind_header(data))[0] > 0,
    "std_msgs/Bool": lambda data: data[0] == 1,  # only on topics with such a name
}


def reports_contact(topic: str, type_name: str) -> bool:
    """Return whether messages of this topic report contacts."""
    return type_name in _TOUCHES and (type_name != "std_msgs/Bool" or is_contact_name(topic))


def is_contact_name(name: str) -> bool:
    """Return whether a topic or a part of the robot is called like a bumper."""
    return _NAMED.search(name) is not None


class Contacts:
    """Notices when a contact begins, on each topic."""

    def __init__(self) -> None:
        self._touched_ns: dict[str, int] = {}  # by topic: the last message with a contact

    def begins(self, topic: str, type_name: str, data: bytes, at_ns: int) -> bool:
        """Return whether this message reports a new contact."""
        try:
            touches = _TOUCHES[type_name](data)
        except (IndexError, struct.error):  # it is no such message
            return False
        if not touches:
            return False
        last_ns = self._touched_ns.get(topic)
        self._touched_ns[topic] = at_ns
        return last_ns is None or at_ns - last_ns > AGAIN_S * 1e9
