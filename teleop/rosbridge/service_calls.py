"""Calls of services: each family may answer some."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

from robots.shared import wire
from robots.shared.sentences import say
from robots.shared.wire import NotDone, Refusal
from teleop.background.jobs import run_in_background
from teleop.live.consumers.message_socket import BUSY
from teleop.rosbridge.control_services import STOP, ControlServices
from teleop.rosbridge.family import Family, Handler, Service
from teleop.rosbridge.operations import CallService, Number, Operation, full_name

MOST_PENDING = 32  # calls of one client


class ServiceCalls(Family):
    """Finds the family that answers a call, and sends its answer."""

    _pending = 0

    def handlers(self) -> Mapping[type[Operation], Handler]:
        return {CallService: self._call}

    async def _call(self, call: CallService) -> None:
        name = full_name(call.service)
        found = ((family, family.service(name)) for family in self.client.families)
        family, service = next(((one, service) for one, service in found if service), (None, None))
        if service is None:
            text = say("{name} is not on the allow-list for this. Ask the staff.", name=name)
            await self._answer(call, Refusal("not_allowed", text, "robot", {"name": name}))
        elif self._pending >= (2 * MOST_PENDING if name == STOP else MOST_PENDING):
            await self._answer(call, BUSY)
        else:
            self._pending += 1
            # Control that came after its refusal would be nobody's
            timeout_s = None if isinstance(family, ControlServices) else call.timeout
            run_in_background(self._run(call, service, timeout_s))

    async def _run(self, call: CallService, service: Service, timeout_s: Number) -> None:
        """Answer within the time that the client gives, if it gives one; the call goes on, and takes its place."""
        answering = asyncio.ensure_future(self._asked(service, call))
        try:
            await asyncio.wait({answering}, timeout=timeout_s if timeout_s and timeout_s > 0 else None)
            await self._answer(
                call, answering.result() if answering.done() else silent(call.service, timeout_s)
            )
            await asyncio.wait({answering})
        finally:
            self._pending -= 1

    async def _asked(self, service: Service, call: CallService) -> dict[str, Any] | Refusal:
        if self.client.has_left:
            return {}
        try:
            return await service({} if full_name(call.service) == STOP else _arguments(call))
        except NotDone as refused:
            return refused.refusal

    async def _answer(self, call: CallService, answer: dict[str, Any] | Refusal) -> None:
        """Send what the service returned, or why it did not run: clients show that text."""
        refused = isinstance(answer, Refusal)
        response = {
            "op": "service_response",
            "service": call.service,
            "values": answer.coded_text if isinstance(answer, Refusal) else answer,
            "result": not refused,
        }
        text = wire.encode(response if call.id is None else {**response, "id": call.id}).decode()
        size = int(call.fragment_size) if call.fragment_size and call.fragment_size >= 1 else None
        await self.client.send_as(text, call.compression or "none", size)
        if isinstance(answer, Refusal) and full_name(call.service) != STOP:  # its button tells and records it
            await self.client.refuse("call_service", answer, call.id)


def silent(service: str, seconds: Number) -> Refusal:
    """Return why a call has no answer."""
    text = say(
        "{service} did not answer within {seconds} s: whether it was carried out is not known.",
        service=service,
        seconds=seconds,
    )
    return Refusal("service_silent", text, "wire", {"service": service})


def _arguments(call: CallService) -> dict[str, Any]:
    """Return the arguments by name. Raises `NotDone`: as a list, only none or one object are understood."""
    args = call.args or {}
    if isinstance(args, list):
        args = args[0] if len(args) == 1 else args
    if not isinstance(args, dict):
        raise NotDone(Refusal("invalid", "Send the arguments of a service as an object, by name.", "wire"))
    return args
