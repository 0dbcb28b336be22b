"""Recognises the messages by which robots report that they touch something. Pure.

Messages of ROS 2 begin with four bytes of CDR. Those of ROS 1 have a number of four bytes in their headers, so that
the frame of a header begins at the same place.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable

from robots.bridge.recorder.black_box.ring import Message
from robots.shared.messages.serialization import CDR
from robots.shared.messages.type_names import bare

CDR_HEAD = len(CDR.head)
_LENGTH = struct.Struct("<I")
_NAMED = re.compile(r"bump|contact|collision", re.IGNORECASE)
AGAIN_S = 5.0  # a contact that ends and comes back sooner is the same one


def _behind_header(data: bytes) -> int:
    """Return where the fields after a std_msgs/Header begin."""
    return 16 + int(_LENGTH.unpack_from(data, 12)[0])


def _bumper_pressed(data: bytes, _head: int) -> bool:
    at = _behind_header(data)
    return any(data[at : at + 2])  # left, right


def _has_contacts(data: bytes, head: int) -> bool:
    at = _behind_header(data)
    at += -at % 4 if head else 0  # a number of CDR begins at a multiple of its width
    return int(_LENGTH.unpack_from(data, at)[0]) > 0


# Whether a message of this type, with so many bytes before it, reports a contact
_TOUCHES: dict[str, Callable[[bytes, int], bool]] = {
    "kobuki_msgs/BumperEvent": lambda data, head: data[head + 1] == 1,  # bumper, state
    "create_msgs/Bumper": _bumper_pressed,
    "ca_msgs/Bumper": _bumper_pressed,
    "gazebo_msgs/ContactsState": _has_contacts,
    "std_msgs/Bool": lambda data, head: data[head] == 1,  # only on topics with such a name
}


def reports_contact(topic: str, type_name: str) -> bool:
    """Return whether messages of this topic report contacts."""
    kind = bare(type_name)
    return kind in _TOUCHES and (kind != "std_msgs/Bool" or is_contact_name(topic))


def is_contact_name(name: str) -> bool:
    """Return whether a topic or a part of the robot is called like a bumper."""
    return _NAMED.search(name) is not None


class Contacts:
    """Notices when a contact begins, on each topic."""

    def __init__(self) -> None:
        self._touched_ns: dict[str, int] = {}  # by topic: the last message with a contact

    def begins(self, message: Message) -> bool:
        """Return whether this message reports a new contact."""
        origin, at_ns = message.origin, message.at_ns
        topic, head = origin.topic, CDR_HEAD if origin.encoding == "cdr" else 0
        try:
            touches = _TOUCHES[bare(origin.type)](message.data, head)
        except (IndexError, struct.error):  # it is no such message
            return False
        if not touches:
            return False
        last_ns = self._touched_ns.get(topic)
        self._touched_ns[topic] = at_ns
        return last_ns is None or at_ns - last_ns > AGAIN_S * 1e9
