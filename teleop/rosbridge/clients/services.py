"""Services of clients: advertised by one client, called by others."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from functools import partial
from itertools import count
from typing import Any, NamedTuple

from fleet.accounts.tokens.models import Scope
from robots.shared.configuration.bridge_config import CLIENTS
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.background.jobs import run_in_background
from teleop.rosbridge.clients.advertised import Advertisements
from teleop.rosbridge.clients.letters import CLIENT_LEFT, Address, Answer, Call
from teleop.rosbridge.clients.post import post_of
from teleop.rosbridge.family import Client, Family, Handler, Service
from teleop.rosbridge.operations import (
    AdvertiseService,
    Operation,
    ServiceResponse,
    UnadvertiseService,
    full_name,
    full_type,
)
from teleop.rosbridge.service_calls import silent

CALL_S = 10.0  # until a client must have answered
LOST_S = CALL_S + 2.0  # the same for who calls: the answer of another web process may get lost
MOST_CALLS = 32  # of one client's services at once


class _Pending(NamedTuple):
    """A call that this client must answer."""

    by: Address
    name: str
    number: str  # the caller's own
    silence: asyncio.TimerHandle


class ClientServices(Family):
    """The services that a client offers, and its calls of those of others."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self.advertised = Advertisements(client, "service")
        self._numbers = count(1)
        self._calls: dict[str, _Pending] = {}  # of this client's services, by id
        self._asked: dict[str, asyncio.Future[Answer]] = {}  # of others' services, by number
        self._post = post_of(client.hub)
        self._address = self._post.join(client.id, {Call: self._called, Answer: self._answered})

    def handlers(self) -> Mapping[type[Operation], Handler]:
        return {
            AdvertiseService: self._advertise,
            UnadvertiseService: self._unadvertise,
            ServiceResponse: self._response,
        }

    def service(self, name: str) -> Service | None:
        return partial(self._call, name) if name.startswith(CLIENTS) else None

    def services(self) -> Mapping[str, str]:
        return self.advertised.listed()

    def leave(self) -> None:
        for number in list(self._calls):
            run_in_background(self._end(number, refusal=CLIENT_LEFT))
        self._post.leave(self.client.id)

    async def _advertise(self, operation: AdvertiseService) -> None:
        self.client.require(Scope.TOPICS)
        self.advertised.add(full_name(operation.service), full_type(operation.type))

    async def _unadvertise(self, operation: UnadvertiseService) -> None:
        if (name := self.advertised.remove(full_name(operation.service))) is None:
            text = say("This client does not advertise {topic}.", topic=operation.service)
            await self.client.status("warning", f"not_advertised: {text}", operation.id)
        for number in [number for number, call in self._calls.items() if call.name == name]:
            await self._end(number, refusal=CLIENT_LEFT)

    # --- as the one that calls --------------------------------------------------------------------------

    async def _call(self, name: str, arguments: dict[str, Any]) -> dict[str, Any]:
        self.client.require(Scope.TOPICS)
        if (server := self.advertised.usable(name)) is None:
            text = say("No client offers {name}.", name=name)
            raise NotDone(Refusal("no_service", text, "robot", {"service": name}))
        number = str(next(self._numbers))
        waiting: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        self._asked[number] = waiting
        try:
            await self._post.send(self._address, server, Call(number, name, arguments))
            answer = await asyncio.wait_for(waiting, LOST_S)
        except TimeoutError as error:
            raise NotDone(silent(name, CALL_S)) from error
        finally:
            del self._asked[number]
        if answer.refusal is not None:
            raise NotDone(answer.refusal)
        return answer.values

    async def _answered(self, _by: Address, answer: Answer) -> None:
        waiting = self._asked.get(answer.number)
        if waiting is not None and not waiting.done():
            waiting.set_result(answer)

    # --- as the one that answers ------------------------------------------------------------------------

    async def _called(self, by: Address, call: Call) -> None:
        """Let this client answer a call of another."""
        own = self.advertised.mine.get(call.name)
        if own is None or len(self._calls) >= MOST_CALLS:
            refusal = CLIENT_LEFT if own is None else _busy(call.name)
            await self._post.send(self._address, by, Answer(call.number, refusal=refusal))
            return
        number = f"call:{next(self._numbers)}"
        silence = asyncio.get_running_loop().call_later(CALL_S, self._give_up, number, call.name)
        self._calls[number] = _Pending(by, call.name, call.number, silence)
        await self.client.send({"op": "call_service", "id": number, "service": own, "args": call.args})

    def _give_up(self, number: str, name: str) -> None:
        run_in_background(self._end(number, refusal=silent(name, CALL_S)))

    async def _response(self, response: ServiceResponse) -> None:
        number = str(response.id)
        if number not in self._calls:
            text = say("No call with this id waits for an answer.")
            raise NotDone(Refusal("no_call", text, "wire"))
        if response.result:
            await self._end(number, response.values if isinstance(response.values, dict) else {})
        else:
            await self._end(number, refusal=_failed(response))

    async def _end(
        self, number: str, values: dict[str, Any] | None = None, refusal: Refusal | None = None
    ) -> None:
        if (call := self._calls.pop(number, None)) is not None:
            call.silence.cancel()
            await self._post.send(self._address, call.by, Answer(call.number, values or {}, refusal))


def _busy(name: str) -> Refusal:
    text = say("More than {most} calls of {service} wait for an answer.", most=MOST_CALLS, service=name)
    return Refusal("busy", text, "wire", {"limit": MOST_CALLS})


def _failed(response: ServiceResponse) -> Refusal:
    text = (
        say(
            "{service} reported a failure: {reason}",
            service=response.service,
            reason=str(response.values)[:300],
        )
        if response.values
        else say("{service} reported a failure and gave no reason.", service=response.service)
    )
    return Refusal("service_failed", text, "robot", {"service": response.service})
