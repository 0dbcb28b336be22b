"""The door of stops by HTTP in the web process: it stops the robots first, and answers afterwards.

`teleop.stop.rights` has judged the request. On the event loop the stop waits for no thread and no other request.
Answers take turns, fair per person: a person with hundreds of requests delays only their own answers.
"""

from __future__ import annotations

import asyncio
import time
from io import BytesIO
from typing import Any

from django.core.handlers.asgi import ASGIRequest
from django.utils import timezone

from fleet.accounts.tokens.services import is_use_due, token_used
from fleet.base.web.stop_addresses import RIGHT, is_of_api
from fleet.server.turns import Turns
from teleop.background.database import in_database_background
from teleop.stop import views
from teleop.stop.emergency_stop import press_shared
from teleop.stop.rights import Right

ANSWERS_AT_ONCE = 3
ANSWER_S = 0.01  # the shortest turn: so who presses again after each answer does not keep the loop busy


class StopDoor:
    """ASGI application: handles stops of people with a right; passes all other requests to `inner`.

    `inner` also makes the answers for pages, and those to requests that another site may have forged.
    """

    def __init__(self, inner: Any) -> None:
        self._inner = inner
        self._answers = Turns(ANSWERS_AT_ONCE)

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Run the ASGI application."""
        right: Right | None = scope.get("extensions", {}).get(RIGHT)
        if right is None:
            await self._inner(scope, receive, send)
            return
        event, body = await _whole(receive)
        of_api = is_of_api(scope["path"])
        outcomes = None
        if right.token is not None or not views.may_be_forged(ASGIRequest(scope, BytesIO(body))):
            robots = right.robots_at(scope["path"])
            outcomes = await press_shared(robots, user=right.person, through="rest" if of_api else "page")
            if right.token is not None and is_use_due(right.token):
                # The row is written later, and many requests share this right until then.
                right.token.used_at = timezone.now()
                in_database_background(token_used, right.token, str((scope["client"] or [""])[0]))
        async with self._answers.turn(right.key):
            end_s = time.monotonic() + ANSWER_S
            if of_api and outcomes is not None:
                await _send(send, views.rest_answer(outcomes))
            else:
                await self._inner(
                    {**scope, "environ": {views.OUTCOMES: outcomes}}, _again(event, body, receive), send
                )
            await asyncio.sleep(max(0.0, end_s - time.monotonic()))


async def _whole(receive: Any) -> tuple[dict[str, Any], bytes]:
    """Return the last event of a request's body, and the body."""
    parts = []
    while (event := await receive())["type"] == "http.request":
        parts.append(event.get("body", b""))
        if not event.get("more_body"):
            break
    return event, b"".join(parts)


def _again(event: dict[str, Any], body: bytes, receive: Any) -> Any:
    """Return a `receive` that returns the body once more."""
    events = [{**event, "body": body}]

    async def receive_again() -> Any:
        return events.pop() if events else await receive()

    return receive_again


async def _send(send: Any, response: Any) -> None:
    headers = [(name.encode(), value.encode()) for name, value in response.items()]
    await send({"type": "http.response.start", "status": response.status_code, "headers": headers})
    await send({"type": "http.response.body", "body": response.content})
