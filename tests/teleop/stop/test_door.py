"""The door of stops in the web process notes the use of a token."""

import asyncio

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Token
from fleet.accounts.tokens.services import token_used
from fleet.base.web.stop_addresses import RIGHT
from fleet.server.credentials import Credential
from teleop.stop import door
from teleop.stop.rights import Right


async def test_many_stops_at_once_note_one_use_of_their_token(monkeypatch):
    queued = []
    monkeypatch.setattr(door, "in_database_background", lambda *job: queued.append(job))
    token = Token()
    right = Right(User(), token, (), Credential("", is_token=True))
    scope = {
        "type": "http",
        "method": "POST",
        "path": "/api/v1/stop",
        "client": ("127.0.0.1", 1),
        "extensions": {RIGHT: right},
    }
    stop_door = door.StopDoor(inner=None)

    async def stop():
        async def receive():
            return {"type": "http.request", "body": b""}

        async def send(_event):
            pass

        await stop_door(scope, receive, send)

    await asyncio.gather(*(stop() for _ in range(20)))
    assert queued == [(token_used, token, "127.0.0.1")]
