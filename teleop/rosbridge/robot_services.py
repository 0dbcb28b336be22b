"""Services about the robot (rosapi), and those of its allow-list."""

from __future__ import annotations

from functools import partial
from typing import Any

from fleet.accounts.tokens.models import Scope
from robots.shared import wire
from robots.shared.configuration.bridge_config import CLIENTS
from teleop.control.allowed.allow_list import required_role
from teleop.live.service_calls import ServiceCall, execute
from teleop.rosbridge.family import Client, Family, Service
from teleop.rosbridge.rosapi.answers import SERVICES, Rosapi, answered


class RobotServices(Family):
    """Answers rosapi, and calls services of the allow-list: for staff in control, recorded first."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._rosapi = Rosapi(self._query, self._execute, self._listed, self._actions)

    def service(self, name: str) -> Service | None:
        if name in SERVICES:
            return partial(self._ask, name)
        if name.startswith(CLIENTS) or required_role(self.client.hub.entry.allowed, "call", name) is None:
            return None
        return partial(self._call, name)

    async def _ask(self, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        self.client.require(Scope.TOPICS)
        return await self._rosapi.call(name, arguments)

    async def _call(self, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        self.client.require(Scope.TOPICS)
        call = wire.CallService(name, arguments, whole=True)
        return answered(await self._execute(call), wire.Called).fields

    async def _query(self, query: wire.TopicQuery | wire.DoorQuery) -> str:
        return await self.client.hub.link.query_topics(query, person=self.client.user.pk)

    async def _execute(self, call: ServiceCall) -> str:
        client = self.client
        return await execute(call, hub=client.hub, user=client.user, rights=client.rights)

    def _listed(self) -> dict[str, str]:
        return {name: type_ for family in self.client.families for name, type_ in family.services().items()}

    def _actions(self) -> set[str]:
        return {name for family in self.client.families for name in family.actions()}
