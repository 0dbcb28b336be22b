"""Offers of the clients of a robot for each other: allowed by the allow-list, gone with the client.

It lives in this process: clients that another web process serves do not see it. It never reaches the robot.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple
from weakref import WeakKeyDictionary

from robots.shared.configuration.bridge_config import CLIENTS
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.control.allow_list import check_role, required_role
from teleop.live.robot_hub import RobotHub
from teleop.rosbridge.family import Client

MOST_ADVERTISED = 20  # of one client

Kind = Literal["service", "action"]


class Advertised(NamedTuple):
    """A service or action of a client. `own`: its name as that client wrote it; `server`: what takes its calls."""

    name: str
    own: str
    type: str
    server: Any


_advertised: WeakKeyDictionary[RobotHub, dict[tuple[Kind, str], Advertised]] = WeakKeyDictionary()


def public_name(name: str) -> str:
    """Return the one name under which other clients find it: no name of the robot's own."""
    return name if name.startswith(CLIENTS) else f"{CLIENTS}{name.lstrip('/')}"


class Advertisements:
    """Offers of one kind, as one client makes and finds it."""

    def __init__(self, client: Client, kind: Kind) -> None:
        self._client = client
        self._kind: Kind = kind
        self._all = _advertised.setdefault(client.hub, {})
        self._mine: set[str] = set()

    def add(self, own: str, type_: str, server: Any) -> None:
        """Advertise something. Raises NotDone."""
        name = public_name(own)
        taken = self._all.get((self._kind, name))
        if taken is not None and name not in self._mine:
            text = say("Another client offers {name} already.", name=name)
            raise NotDone(Refusal("name_taken", text, "wire", {"name": name}))
        if len(self._mine) >= MOST_ADVERTISED and name not in self._mine:
            text = say("A client offers at most {most} services and {most} actions.", most=MOST_ADVERTISED)
            raise NotDone(Refusal("too_many_advertised", text, "wire", {"most": MOST_ADVERTISED}))
        self._require_role(name, type_)
        self._all[self._kind, name] = Advertised(name, own, type_, server)
        self._mine.add(name)

    def remove(self, own: str) -> bool:
        """Take something back. Return whether it was advertised."""
        name = public_name(own)
        if name not in self._mine:
            return False
        self._mine.discard(name)
        del self._all[self._kind, name]
        return True

    def remove_all(self) -> None:
        for name in list(self._mine):
            self.remove(name)

    def find(self, name: str) -> Advertised | None:
        """Return what any client advertises by this name."""
        return self._all.get((self._kind, name))

    def usable(self, advertised: Advertised) -> Advertised:
        """Return it if this client may use it. Raises NotDone."""
        self._require_role(advertised.name, advertised.type)
        return advertised

    def listed(self) -> Iterator[Advertised]:
        return (advertised for (kind, _), advertised in self._all.items() if kind == self._kind)

    def _require_role(self, name: str, type_: str) -> None:
        needed = required_role(self._client.hub.entry.allowed, "call", name, type_)
        if refusal := check_role(self._client.rights, needed, name):
            raise NotDone(refusal)
