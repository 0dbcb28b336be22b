"""Actions of clients by topics, as in ROS 1: what a client publishes on them reaches other clients, not the robot."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary, WeakSet

from fleet.accounts.tokens.models import Scope
from robots.shared.configuration.bridge_config import CLIENTS
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.control.allow_list import check_role, required_role
from teleop.live.robot_hub import RobotHub
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

_here: WeakKeyDictionary[RobotHub, WeakSet[ActionTopics]] = WeakKeyDictionary()


class ActionTopics(Family):
    """The topics of actions that clients advertise for each other. The first server has them until it leaves."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._serves: set[str] = set()  # actions
        self._all = _here.setdefault(client.hub, WeakSet())
        self._all.add(self)

    def publisher(self, topic: str) -> Handler | None:
        name, _, part = topic.rpartition("/")
        if part not in (*OF_SERVER, *OF_ASKER) or not name.startswith(CLIENTS):
            return None
        wanted = "call", name
        allowed = self.client.hub.entry.allowed
        offered = any((one.what, one.name) == wanted and one.type.endswith("Action") for one in allowed)
        return self._publish if offered else None

    def leave(self) -> None:
        self._all.discard(self)

    async def _publish(self, operation: Publish) -> None:
        self.client.require(Scope.TOPICS)
        topic = full_name(operation.topic)
        name, _, part = topic.rpartition("/")
        needed = required_role(self.client.hub.entry.allowed, "call", name)
        if refusal := check_role(self.client.rights, needed, name):
            raise NotDone(refusal)
        if part in OF_SERVER:
            if any(name in other._serves for other in self._all if other is not self):
                text = say("Another client offers {name} already.", name=name)
                raise NotDone(Refusal("name_taken", text, "wire", {"name": name}))
            self._serves.add(name)
        message = (OF_SERVER | OF_ASKER)[part] | operation.msg
        for one in list(self._all):
            for family in one.client.families:
                await family.show(topic, message)
