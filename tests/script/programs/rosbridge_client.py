"""A client of the rosbridge door, as small as the console's own `Driver`: it sends operations and keeps answers."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Self

import msgspec
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from script.stack.stack import Stack

ANSWER_S = 10.0


class RosbridgeClient:
    """Async context: one open connection. `status` has what the console said."""

    def __init__(self, stack: Stack, slug: str, token: str, port: int | None = None) -> None:
        self._address = f"ws://{stack.hosts[0]}:{port or stack.port}/rosbridge/{slug}"
        self._headers = {"Authorization": f"Bearer {token}"}
        self._answers: dict[str, asyncio.Future[Any]] = {}
        self._news = asyncio.Condition()
        self.status: list[str] = []
        self.messages: list[dict[str, Any]] = []  # of topics, and of other clients

    async def __aenter__(self) -> Self:
        self.socket = await connect(
            self._address,
            additional_headers=self._headers,
            compression=None,
            ping_interval=None,
            max_size=None,
        )
        self._reader = asyncio.create_task(self._read())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.socket.close()
        self._reader.cancel()
        with suppress(asyncio.CancelledError):
            await self._reader

    async def call(self, service: str) -> Any:
        """Call a service without arguments; return its values. Raises `AssertionError`: refused."""
        response = await self.ask(service)
        if not response["result"]:
            raise AssertionError(f"{service}: {response['values']}")
        return response["values"]

    async def ask(self, service: str, **args: Any) -> dict[str, Any]:
        """Call a service; return the response."""
        answer = self._answers[service] = asyncio.get_running_loop().create_future()
        await self.send({"op": "call_service", "service": service, "id": service, "args": args})
        response: dict[str, Any] = await asyncio.wait_for(answer, ANSWER_S)
        return response

    async def until(self, condition: Callable[[], Any], within_s: float = ANSWER_S) -> None:
        """Wait until `condition()` is true; it is called again after every operation of the console."""
        async with self._news:
            await asyncio.wait_for(self._news.wait_for(condition), within_s)

    async def told(self, code: str) -> None:
        """Wait for a status with this code."""
        await self.until(lambda: any(text.startswith(f"{code}: ") for text in self.status))

    def pause(self) -> None:
        """Read nothing more: the client is stuck."""
        self.socket.transport.pause_reading()

    def resume(self) -> None:
        """Read on."""
        self.socket.transport.resume_reading()

    async def send(self, operation: dict[str, Any]) -> None:
        await self.socket.send(msgspec.json.encode(operation), text=True)

    async def drive(self, mps: float, radps: float) -> None:
        """Publish a velocity."""
        message = {"linear": {"x": mps, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": radps}}
        await self.send({"op": "publish", "topic": "/cmd_vel", "msg": message})

    async def _read(self) -> None:
        with suppress(ConnectionClosed):
            async for raw in self.socket:
                message = json.loads(raw)
                is_answer = message["op"] == "service_response"
                if is_answer and (answer := self._answers.get(message["id"])):
                    answer.set_result(message)
                async with self._news:
                    if message["op"] == "status":
                        self.status.append(message["msg"])
                    elif not is_answer:
                        self.messages.append(message)
                    self._news.notify_all()
