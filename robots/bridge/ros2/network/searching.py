"""Where a robot may be that does not answer, and how this computer searched for it."""

from __future__ import annotations

import contextlib
import selectors
import socket
import struct
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path

from robots.bridge.ros2.network.graph import nodes
from robots.bridge.ros2.network.interfaces import interfaces
from robots.bridge.ros2.participant import Participant
from robots.shared.configuration.robot_ros import Ros2
from robots.shared.graph import is_own
from robots.shared.processes.probe_findings import CALLER, Plan
from robots.shared.ros2.environment import MULTICAST
from robots.shared.sentences import joined, say

FOUND_S = 3.5  # by which nodes are found: each announces itself every 3 s
SEARCHED = range(10)  # domains in which a robot is searched that is not in its own
DOMAINS = range(102)  # that have ports of their own on any computer
# Source: DDSI-RTPS 2.2, section 9.6.1
FIRST_PORT, PORTS = 7400, 250  # each domain has so many ports
FIRST_UNICAST = 10  # of a domain's ports; each process has two, the first one even
BEGIN = b"RTPS"  # of each datagram
ASKED_PROCESSES = 4  # of a computer: whether any listens
REFUSED_S = 0.3  # until a computer has said that nothing listens
LEAVE_S = 0.2


def others(participant: Participant) -> list[str]:
    """Return the names of all nodes that are no processes of a console."""
    known = participant.node.get_node_names_and_namespaces()
    names = (f"{space.rstrip('/')}/{name}" for name, space in known)
    return [name for name in names if not is_own(name) and name != CALLER]


def unknown_address(ros: Ros2) -> str | None:
    """Return the computer that this one should ask, but does not know: then rclpy joins no domain at all."""
    server = ros.discovery_server.rpartition(":")[0]
    asked = [server] if server else ros.static_peers
    return next((name for name in asked if _address(name) is None), None)


def why_not_found(plan: Plan, ros: Ros2) -> str:
    """Return where nodes are, and how this computer searched."""
    elsewhere = sorted({*SEARCHED, *_domains_here()} - {ros.domain_id})
    whys: list[str] = [say("No node answers in domain {domain}.", domain=ros.domain_id)]
    with ExitStack() as opened:
        heard = _Announcements(opened)
        joined_there = {}
        for domain in elsewhere:
            joined_there[domain] = participant = Participant(CALLER.strip("/"), domain)
            opened.callback(participant.close, LEAVE_S)
        announced = heard.within(FOUND_S)
        for domain, participant in joined_there.items():
            whys += _nodes_there(participant, domain, plan.listened[0].topic)
            if others(participant):
                announced.pop(domain, None)
    for domain, addresses in sorted(announced.items()):
        words = "{address} announces nodes in domain {domain}."
        if domain == ros.domain_id:
            words = (
                "{address} announces nodes in domain {domain}, but they do not answer: is there a firewall?"
            )
        whys.append(say(words, address=", ".join(sorted(addresses)), domain=domain))
    return joined(" ", [*whys, *_searched(ros)])


def _nodes_there(participant: Participant, domain: int, odometry: str) -> Iterator[str]:
    robots = nodes(participant.node.get_publishers_info_by_topic(odometry))
    if robots:
        words = "{node} publishes {topic} in domain {domain}: is that the robot?"
        yield say(words, node=robots[0], topic=odometry, domain=domain)
    elif found := others(participant):
        yield say("{nodes} answers in domain {domain}.", nodes=found[0], domain=domain)


def _searched(ros: Ros2) -> Iterator[str]:
    """Yield how far this computer searched, and what of it cannot work."""
    if ros.discovery_server:
        yield say("Only the discovery server {server} was asked.", server=ros.discovery_server)
        host, _, port = ros.discovery_server.rpartition(":")
        if _refuses(host, [int(port)]):
            yield say("Nothing listens at {server}.", server=ros.discovery_server)
        return
    if ros.discovery == "localhost":
        yield say("The search stays on this computer.")
    elif ros.discovery == "off":
        yield say("Only the static peers were asked.")
    elif leaving := [f"{one.address} ({one.name})" for one in sorted(interfaces()) if one.takes_multicast]:
        yield say("Multicast can leave this computer from {address}.", address=", ".join(leaving))
    else:
        yield say("No network of this computer takes multicast.")
    first = FIRST_PORT + PORTS * ros.domain_id + FIRST_UNICAST
    for peer in ros.static_peers:
        if _refuses(peer, range(first, first + 2 * ASKED_PROCESSES, 2)):
            words = "{peer} is on, but no node listens there in domain {domain}."
            yield say(words, peer=peer, domain=ros.domain_id)


def _domains_here() -> set[int]:
    """Return the domains in which processes of this computer listen, also those that search on this computer only."""
    lines = Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]
    ports = {int(line.split()[1].rpartition(":")[2], 16) for line in lines}
    found = (divmod(port - FIRST_PORT, PORTS) for port in ports if port + 1 in ports)
    return {domain for domain, at in found if at >= FIRST_UNICAST and not at % 2 and domain in DOMAINS}


class _Announcements:
    """Announcements of nodes of other computers by multicast, in every domain. Nothing is sent."""

    def __init__(self, opened: ExitStack) -> None:
        self._selector = opened.enter_context(selectors.DefaultSelector())
        networks = interfaces()
        self._own = {one.address for one in networks} | {"127.0.0.1"}
        for domain in DOMAINS:
            listening = opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            listening.setblocking(False)
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            with contextlib.suppress(OSError):  # the port, or multicast, is not to be had
                listening.bind((MULTICAST, FIRST_PORT + PORTS * domain))
                for one in networks:
                    membership = struct.pack("4s4si", socket.inet_aton(MULTICAST), bytes(4), one.number)
                    listening.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
                self._selector.register(listening, selectors.EVENT_READ, domain)

    def within(self, seconds: float) -> dict[int, set[str]]:
        """Return the addresses that announce something, by domain."""
        found: defaultdict[int, set[str]] = defaultdict(set)
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0:
            for key, _ in self._selector.select(left_s):
                with contextlib.suppress(OSError):
                    datagram, (address, *_) = key.fileobj.recvfrom(len(BEGIN))  # type: ignore[union-attr]
                    if datagram == BEGIN and address not in self._own:
                        found[key.data].add(address)
        return dict(found)


def _refuses(host: str, ports: Iterable[int]) -> bool:
    """Return whether this computer answers that nothing listens on any of the ports. Silence is no answer."""
    address = _address(host)
    return address is not None and all(_is_closed(address, port) for port in ports)


def _is_closed(address: str, port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        asking.settimeout(REFUSED_S)
        try:
            asking.connect((address, port))
            asking.send(b"\0")
            asking.recv(1)
        except ConnectionRefusedError:
            return True
        except OSError:
            return False
        return False


def _address(host: str) -> str | None:
    try:
        return str(socket.getaddrinfo(host, None, socket.AF_INET)[0][4][0])
    except OSError:
        return None
