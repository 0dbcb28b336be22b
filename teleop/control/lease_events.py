"""Word from one web process to the others that a robot's lease changed: read it again.

Only a hint, and it may get lost: whoever misses it finds out at the next look. Nothing is granted, revoked or
stopped by it.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from contextlib import suppress
from uuid import UUID, uuid4

from channels.layers import get_channel_layer

log = logging.getLogger(__name__)

_RETRY_S = 2.0


class LeaseEvents:
    """The hints about one robot."""

    def __init__(self, robot_id: UUID, on_change: Callable[[], Awaitable[None]]) -> None:
        self._group = f"control.{robot_id.hex}"
        self._on_change = on_change
        self._name = uuid4().hex
        self._task = asyncio.create_task(self._listen())

    async def publish(self) -> None:
        """Tell the other web processes."""
        layer = get_channel_layer()
        if layer is None:
            return
        try:
            await layer.group_send(self._group, {"type": "control.changed", "by": self._name})
        except Exception as error:  # noqa: BLE001 - each backend has its own; the slow look makes up for it
            log.warning("a hint was not sent: %s", error)

    async def close(self) -> None:
        """Listen no more."""
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    async def _listen(self) -> None:
        layer = get_channel_layer()
        while layer is not None:
            try:
                channel = await layer.new_channel()
                await layer.group_add(self._group, channel)
                try:
                    while True:
                        hint = await layer.receive(channel)
                        if hint["by"] != self._name:
                            await self._on_change()
                finally:
                    await layer.group_discard(self._group, channel)
            except Exception as error:  # noqa: BLE001 - the edge of the loop: it begins again
                log.warning("no hints from other web processes now: %s", error)
                await asyncio.sleep(_RETRY_S)
