"""The networks of this computer. DDS looks at them once, when a process joins a domain: later ones are not used."""

from __future__ import annotations

import fcntl
import socket
import struct
from typing import NamedTuple

from robots.shared.configuration.robot_ros import Ros2

# Source: netdevice(7)
GET_FLAGS, GET_ADDRESS = 0x8913, 0x8915  # SIOCGIFFLAGS, SIOCGIFADDR
LOOPBACK, RUNNING, MULTICAST = 0x8, 0x40, 0x1000  # IFF_...
REQUEST = struct.Struct("16s24x")  # struct ifreq: the name, room for the answer
ANSWER_AT = 16
ADDRESS_AT = ANSWER_AT + 4  # behind the family and the port of a sockaddr_in


class Interface(NamedTuple):
    """A network interface with an IPv4 address and a carrier. A new one may have the name of one that has gone."""

    name: str
    number: int
    address: str
    takes_multicast: bool


def interfaces() -> frozenset[Interface]:
    """Return the interfaces that DDS uses when a process joins now, without the loopback."""
    found = set()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        for number, name in socket.if_nameindex():
            request = REQUEST.pack(name.encode())
            try:
                answer = fcntl.ioctl(asking, GET_FLAGS, request)
                (flags,) = struct.unpack_from("=H", answer, ANSWER_AT)
                if flags & LOOPBACK or not flags & RUNNING:
                    continue
                answer = fcntl.ioctl(asking, GET_ADDRESS, request)
            except OSError:  # it has no address, or has just gone
                continue
            address = socket.inet_ntoa(answer[ADDRESS_AT : ADDRESS_AT + 4])
            found.add(Interface(name, number, address, bool(flags & MULTICAST)))
    return frozenset(found)


class Joined:
    """The interfaces when this process joined a domain, and what has become of them."""

    def __init__(self, ros: Ros2) -> None:
        self._stays_here = ros.discovery == "localhost" and not ros.discovery_server
        self._before = interfaces()

    def new(self) -> bool:
        """Return whether there is one that DDS does not use."""
        return bool(interfaces() - self._before) and not self._stays_here

    def moved(self) -> bool:
        """Return whether one that DDS uses has another address now, as DHCP gives one."""
        before, now = self._before, interfaces()
        has_gone = {one.number for one in before - now}
        return self.new() and any(one.number in has_gone for one in now - before)
