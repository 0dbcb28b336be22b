"""A group of the channel layer: messages between web processes. Any of them may get lost."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from channels.layers import get_channel_layer

from teleop.background.jobs import run_in_background

log = logging.getLogger(__name__)

_RETRY_S = 2.0
_JOIN_AGAIN_S = 6 * 3600.0  # a layer forgets after a day who joined a group


async def keep_receiving(
    group: str,
    receive: Callable[[dict[str, Any]], Awaitable[None]],
    joined: Callable[[str], None] = lambda _channel: None,
) -> None:
    """Receive the messages to a group, until cancelled. `joined` gets the own channel, after a fault a new one."""
    layer, reachable = get_channel_layer(), True
    while layer is not None:
        try:
            channel = await layer.new_channel()
            await layer.group_add(group, channel)
            joining = run_in_background(_keep_joining(layer, group, channel))
            joined(channel)
            reachable = True
            try:
                while True:
                    await receive(await layer.receive(channel))
            finally:
                joining.cancel()
                await layer.group_discard(group, channel)
        except Exception as error:  # noqa: BLE001 - the outermost level: the loop starts again
            if reachable:
                log.warning("No messages to %s arrive from other web processes now: %s", group, error)
            reachable = False
            await asyncio.sleep(_RETRY_S)


async def _keep_joining(layer: Any, group: str, channel: str) -> None:
    while True:
        await asyncio.sleep(_JOIN_AGAIN_S)
        await layer.group_add(group, channel)
