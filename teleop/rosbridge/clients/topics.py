"""Actions of clients by topics, as in ROS 1: what a client publishes on them reaches other clients, not the robot."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fleet.accounts.tokens.models import Scope
from robots.shared.configuration.bridge_config import CLIENTS
from robots.shared.messages.type_names import is_action
from robots.shared.wire import NotDone
from teleop.control.allowed.allow_list import check_role, required_role
from teleop.rosbridge.clients.advertised import Advertisements
from teleop.rosbridge.clients.letters import Address, Shown
from teleop.rosbridge.clients.post import post_of
from teleop.rosbridge.family import Client, Family, Handler
from teleop.rosbridge.operations import Publish, full_name

_ID: dict[str, Any] = {"stamp": {"secs": 0, "nsecs": 0}, "id": ""}
# Parts of an action with the fields that clients may leave out: those that its server publishes, and the others
OF_SERVER: dict[str, dict[str, Any]] = {
    "status": {"status_list": []},
    "feedback": {"feedback": {}},
    "result": {"result": {}},
}
OF_ASKER: dict[str, dict[str, Any]] = {"goal": {"goal_id": _ID, "goal": {}}, "cancel": _ID}


class ActionTopics(Family):
    """The topics of actions that clients advertise for each other. The first server has them until it leaves."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._served = Advertisements(client, "topics")
        self._post = post_of(client.hub)
        self._address = self._post.join(client.id, {Shown: self._shown})

    def publisher(self, topic: str) -> Handler | None:
        name, _, part = topic.rpartition("/")
        if part not in (*OF_SERVER, *OF_ASKER) or not name.startswith(CLIENTS):
            return None
        return self._publish if self._type(name) is not None else None

    def actions(self) -> Iterable[str]:
        return self._served.listed()

    def leave(self) -> None:
        self._post.leave(self.client.id)

    def _type(self, name: str) -> str | None:
        """Return the type of an action on the allow-list."""
        allowed = self.client.hub.entry.allowed
        types = (one.type for one in allowed if (one.what, one.name) == ("call", name))
        return next((type_ for type_ in types if is_action(type_)), None)

    async def _publish(self, operation: Publish) -> None:
        self.client.require(Scope.TOPICS)
        topic = full_name(operation.topic)
        name, _, part = topic.rpartition("/")
        needed = required_role(self.client.hub.entry.allowed, "call", name)
        if refusal := check_role(self.client.rights, needed, name):
            raise NotDone(refusal)
        if part in OF_SERVER and name not in self._served.mine:
            self._served.add(name, self._type(name) or "")
        message = (OF_SERVER | OF_ASKER)[part] | operation.msg
        await self._post.show(self._address, Shown(topic, message))

    async def _shown(self, _by: Address, shown: Shown) -> None:
        for family in self.client.families:
            await family.show(shown.topic, shown.message)
