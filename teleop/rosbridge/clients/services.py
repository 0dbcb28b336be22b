"""Services of clients: advertised by one client, called by others."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from functools import partial
from itertools import count
from typing import Any

from fleet.accounts.tokens.models import Scope
from robots.shared.configuration.bridge_config import CLIENTS
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.rosbridge.clients.advertised import Advertised, Advertisements
from teleop.rosbridge.family import Client, Family, Handler, Service
from teleop.rosbridge.operations import (
    AdvertiseService,
    Operation,
    ServiceResponse,
    UnadvertiseService,
    full_name,
    full_type,
)

CALL_S = 10.0  # until a client must have answered
MOST_CALLS = 32  # of one client's services at once

CLIENT_LEFT = Refusal("client_left", "The client that offers this left.", "wire")


class ClientServices(Family):
    """The services that a client offers, and its calls of those of others."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self.advertised = Advertisements(client, "service")
        self._numbers = count(1)
        self._calls: dict[str, asyncio.Future[dict[str, Any]]] = {}  # of this client's services, by id

    def handlers(self) -> Mapping[type[Operation], Handler]:
        return {
            AdvertiseService: self._advertise,
            UnadvertiseService: self._unadvertise,
            ServiceResponse: self._response,
        }

    def service(self, name: str) -> Service | None:
        return partial(self._call, name) if name.startswith(CLIENTS) else None

    def services(self) -> Mapping[str, str]:
        return {advertised.name: advertised.type for advertised in self.advertised.listed()}

    def leave(self) -> None:
        self.advertised.remove_all()
        for call in self._calls.values():
            if not call.done():
                call.set_exception(NotDone(CLIENT_LEFT))

    async def _advertise(self, operation: AdvertiseService) -> None:
        self.client.require(Scope.TOPICS)
        self.advertised.add(full_name(operation.service), full_type(operation.type), self)

    async def _unadvertise(self, operation: UnadvertiseService) -> None:
        if not self.advertised.remove(full_name(operation.service)):
            text = say("This client does not advertise {topic}.", topic=operation.service)
            await self.client.status("warning", f"not_advertised: {text}", operation.id)

    async def _call(self, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        self.client.require(Scope.TOPICS)
        if (advertised := self.advertised.find(name)) is None:
            text = say("No client offers {name}.", name=name)
            raise NotDone(Refusal("no_service", text, "robot", {"service": name}))
        server: ClientServices = self.advertised.usable(advertised).server
        return await server.answer(advertised, arguments)

    async def answer(self, advertised: Advertised, arguments: dict[str, Any]) -> dict[str, Any]:
        """Let this client answer a call of another. Raises NotDone."""
        if len(self._calls) >= MOST_CALLS:
            text = say(
                "More than {most} calls of {service} wait for an answer.",
                most=MOST_CALLS,
                service=advertised.name,
            )
            raise NotDone(Refusal("busy", text, "wire", {"limit": MOST_CALLS}))
        number = f"call:{next(self._numbers)}"
        call = self._calls[number] = asyncio.get_running_loop().create_future()
        try:
            await self.client.send(
                {"op": "call_service", "id": number, "service": advertised.own, "args": arguments}
            )
            return await asyncio.wait_for(call, CALL_S)
        except TimeoutError as error:
            text = say(
                "{service} did not answer within {seconds} s: whether it was carried out is not known.",
                service=advertised.name,
                seconds=CALL_S,
            )
            raise NotDone(Refusal("service_silent", text, "wire", {"service": advertised.name})) from error
        finally:
            del self._calls[number]

    async def _response(self, response: ServiceResponse) -> None:
        call = self._calls.get(str(response.id))
        if call is None or call.done():
            text = say("No call with this id waits for an answer.")
            raise NotDone(Refusal("no_call", text, "wire"))
        if response.result:
            call.set_result(response.values if isinstance(response.values, dict) else {})
            return
        text = (
            say(
                "{service} reported a failure: {reason}",
                service=response.service,
                reason=str(response.values)[:300],
            )
            if response.values
            else say("{service} reported a failure and gave no reason.", service=response.service)
        )
        call.set_exception(NotDone(Refusal("service_failed", text, "robot", {"service": response.service})))
