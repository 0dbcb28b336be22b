"""An application that never completes its first answer to each method."""

import asyncio
import os
from pathlib import Path


def lasts(scope):
    begun = Path(os.environ["FLEET_VAR"], scope["method"])
    if scope["path"] != "/lasting" or begun.exists():
        return False
    begun.touch()
    return True


async def application(scope, receive, send):
    if lasts(scope):
        await asyncio.Event().wait()
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"0")]})
    await send({"type": "http.response.body"})
