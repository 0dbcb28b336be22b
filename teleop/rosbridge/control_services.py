"""Services of the console itself: control is taken by a call, never by publishing. A stop is one, too."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from typing import Any
from uuid import UUID

from django.db import DatabaseError

from robots.link.stop_delivery import SILENT
from robots.shared.wire import Control, NotDone, Stopped
from teleop.background.jobs import run_in_background
from teleop.control.allowed.scopes import ACTING
from teleop.control.changes import database_refusal
from teleop.control.lease_checks import NO_LEASE
from teleop.live.control_holder import ControlHolder
from teleop.rosbridge.family import Client, Family, Service
from teleop.rosbridge.publishing import Publishing
from teleop.stop.presses import Pending

log = logging.getLogger(__name__)

STOP = "/fleet/stop"
ANSWER_S = 6.0  # a bridge that has not answered after 5 s counts as silent


class ControlServices(Family):
    """Take, renew, give back and wait for control; stop the robot."""

    def __init__(self, client: Client) -> None:
        super().__init__(client)
        self._news = asyncio.Event()
        self._one = asyncio.Lock()  # one step after the other
        self._steps: set[asyncio.Task[None]] = set()
        self._services: dict[str, Callable[[ControlHolder], Awaitable[None]]] = {
            "/fleet/take_control": self._take,
            "/fleet/renew_control": lambda control: control.renew(),
            "/fleet/release_control": lambda control: control.release(),
            "/fleet/ask_control": lambda control: control.ask(),
        }

    def service(self, name: str) -> Service | None:
        if name == STOP:
            return self._stopped
        step = self._services.get(name)
        return None if step is None else lambda _arguments: self._change(step)

    def services(self) -> Mapping[str, str]:
        return dict.fromkeys((STOP, *self._services), "fleet/Control")

    def control_changed(self, control: Control) -> None:
        self._news.set()

    async def _stopped(self, _arguments: dict[str, Any]) -> dict[str, Any]:
        """Answer when the stop, which the consumer has sent, is confirmed. Raises NotDone if it is not yet."""
        answer = asyncio.shield(asyncio.wrap_future(self.client.stop_answer))
        try:
            result = await asyncio.wait_for(answer, ANSWER_S)
        except TimeoutError as error:
            raise NotDone(SILENT) from error
        if isinstance(result, Stopped):
            return {}
        raise NotDone(result.refusal if isinstance(result, Pending) else result)

    async def _change(self, step: Callable[[ControlHolder], Awaitable[None]]) -> dict[str, Any]:
        self.client.require(*ACTING)
        if (control := self.client.control) is None:
            raise NotDone(NO_LEASE)
        running = asyncio.ensure_future(self._in_turn(step, control))
        self._steps.add(running)
        try:
            await running
        except DatabaseError as error:
            log.error("Control of robot %s: %s", self.client.hub.robot_id, error)
            raise NotDone(database_refusal(error)) from error
        finally:
            self._steps.discard(running)
        return self._told()

    async def _in_turn(
        self, step: Callable[[ControlHolder], Awaitable[None]], control: ControlHolder
    ) -> None:
        async with self._one:
            await step(control)

    def leave(self) -> None:
        """Drop what waits: nobody is there who could drive."""
        for running in list(self._steps):
            running.cancel()

    async def _take(self, control: ControlHolder) -> None:
        """Take control. Wait until the bridge knows it, and send it a zero: then the first velocity drives."""
        self._news.clear()
        taking = asyncio.ensure_future(control.take_control())
        try:
            await asyncio.shield(taking)
            await asyncio.wait_for(self._until_yours(), ANSWER_S)
        except TimeoutError as error:
            control.undo_take(taking.result(), SILENT)
            raise NotDone(SILENT) from error
        except asyncio.CancelledError:  # the database may be taking it
            run_in_background(_undo(control, taking))
            raise
        for family in self.client.families:
            if isinstance(family, Publishing):
                await family.stand()

    async def _until_yours(self) -> None:
        while not (self.client.fence and (told := self.client.control_told) and told.state == "yours"):
            self._news.clear()
            await self._news.wait()

    def _told(self) -> dict[str, Any]:
        """Return the state of control for the client."""
        control = self.client.control_told or Control("free")
        return {
            "state": control.state,
            "holder": control.holder or "",
            "seconds": control.remaining_s or 0.0,
            "ahead": -1 if control.ahead is None else control.ahead,
        }


async def _undo(control: ControlHolder, taking: asyncio.Future[UUID]) -> None:
    """Give back what is taken for a client that is gone."""
    with suppress(NotDone, DatabaseError):
        control.undo_take(await taking)
