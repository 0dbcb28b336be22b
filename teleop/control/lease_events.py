"""Events between web processes: "this robot's lease changed, read it again".

An event may get lost; then the other processes see the change at their next regular read. An event grants, revokes
and stops nothing.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any
from uuid import UUID, uuid4

from channels.layers import get_channel_layer

from teleop.background.channel_group import keep_receiving

log = logging.getLogger(__name__)


class LeaseEvents:
    """Publishes and receives the events of one robot."""

    def __init__(self, robot_id: UUID, on_change: Callable[[], Awaitable[None]]) -> None:
        self._group = f"control.{robot_id.hex}"
        self._on_change = on_change
        self._origin = uuid4().hex
        self._task = asyncio.create_task(keep_receiving(self._group, self._receive))

    async def publish(self) -> None:
        """Inform the other web processes."""
        layer = get_channel_layer()
        if layer is None:
            return
        try:
            await layer.group_send(self._group, {"type": "control.changed", "by": self._origin})
        except Exception as error:  # noqa: BLE001 - each backend has its own errors; the regular reads continue
            log.warning("Other web processes were not informed that a lease changed: %s", error)

    async def close(self) -> None:
        """Stop listening."""
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    async def _receive(self, event: dict[str, Any]) -> None:
        if event["by"] != self._origin:
            await self._on_change()
