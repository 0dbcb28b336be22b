"""A client of the rosbridge door, which speaks with the console as roslibjs and roslibpy do."""

from __future__ import annotations

import json
from typing import Any

from tests.teleop.support import Page


class Client(Page):
    """One client. `send` and `hears_op` use operations instead of the console's own messages."""

    def __init__(self, slug: str, *, token: str | None = None, query: str = "", **headers: str) -> None:
        lines = {"host": "testserver", "origin": "http://lab.example", **headers}
        if token is not None:
            lines["authorization"] = f"Bearer {token}"
        encoded = [(name.encode(), value.encode()) for name, value in lines.items()]
        super().__init__(encoded, f"/rosbridge/{slug}{query}")

    async def send(self, op: str, **fields: Any) -> None:
        await self.say_raw(json.dumps({"op": op, **fields}))

    async def hears_op(self, op: str, **fields: Any) -> dict[str, Any]:
        """Return the next operation of this kind with these fields; earlier ones go to `inbox`."""
        try:
            while True:
                message = await self._message()
                if message.get("op") == op and fields.items() <= message.items():
                    return message
                self.inbox.append(message)
        except TimeoutError as error:
            raise AssertionError(f"no {op} {fields}; instead: {self.inbox}") from error

    async def told(self, code: str) -> dict[str, Any]:
        """Return the next status message with this code."""
        while True:
            status = await self.hears_op("status")
            if status["msg"].startswith(f"{code}: "):
                return status
            self.inbox.append(status)

    async def call(self, service: str, /, **args: Any) -> dict[str, Any]:
        """Call a service; return its answer."""
        await self.send("call_service", service=service, args=args, id=f"call_service:{service}")
        return await self.hears_op("service_response", service=service, id=f"call_service:{service}")

    async def take(self) -> None:
        answer = await self.call("/fleet/take_control")
        assert answer["result"], answer
