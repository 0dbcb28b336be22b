"""Offers of the clients of a robot for each other: allowed by the allow-list, gone with the client."""

from __future__ import annotations

from robots.shared.configuration.bridge_config import CLIENTS
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.control.allowed.allow_list import check_role, required_role
from teleop.rosbridge.clients.letters import Address, Kind, Offer
from teleop.rosbridge.clients.post import post_of
from teleop.rosbridge.family import Client

MOST_ADVERTISED = 20  # of one client


def public_name(name: str) -> str:
    """Return the one name under which other clients find it: no name of the robot's own."""
    return name if name.startswith(CLIENTS) else f"{CLIENTS}{name.lstrip('/')}"


class Advertisements:
    """Offers of one kind, as one client makes and finds it."""

    def __init__(self, client: Client, kind: Kind) -> None:
        self._client = client
        self._kind: Kind = kind
        self._post = post_of(client.hub)
        self.mine: dict[str, str] = {}  # by name: as this client wrote it

    def add(self, own: str, type_: str) -> None:
        """Advertise something. Raises NotDone."""
        name = public_name(own)
        if name not in self.mine:
            if self._post.find(self._kind, name) is not None:
                text = say("Another client offers {name} already.", name=name)
                raise NotDone(Refusal("name_taken", text, "wire", {"name": name}))
            if len(self.mine) >= MOST_ADVERTISED:
                text = say(
                    "A client offers at most {most} services and {most} actions.", most=MOST_ADVERTISED
                )
                raise NotDone(Refusal("too_many_advertised", text, "wire", {"most": MOST_ADVERTISED}))
        self._require_role(name, type_)
        self.mine[name] = own
        self._post.offer(Offer(self._kind, name, type_, self._client.id))

    def remove(self, own: str) -> str | None:
        """Take something back. Return its name; None: this client does not advertise it."""
        name = public_name(own)
        if self.mine.pop(name, None) is None:
            return None
        self._post.take_back(self._kind, name)
        return name

    def usable(self, name: str) -> Address | None:
        """Return the client that advertises this; None: no client. Raises NotDone unless this client may use it."""
        if (found := self._post.find(self._kind, name)) is None:
            return None
        offer, address = found
        self._require_role(name, offer.type)
        return address

    def listed(self) -> dict[str, str]:
        """Return all that clients advertise, with the types."""
        return {offer.name: offer.type for offer in self._post.listed(self._kind)}

    def _require_role(self, name: str, type_: str) -> None:
        needed = required_role(self._client.hub.entry.allowed, "call", name, type_)
        if refusal := check_role(self._client.rights, needed, name):
            raise NotDone(refusal)
