"""Answers that wait on the event loop: hundreds of clients may wait for news, and none of them holds a thread."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import msgspec
from django.http import HttpResponse


class LongPoll(HttpResponse):
    """The answer as it is now. `fleet.site.handler` awaits `wait` on the loop, then calls `renew` in a thread.

    Another server answers at once: a client that waits asks again.
    """

    def __init__(self, now: Any, wait: Callable[[], Awaitable[None]], read: Callable[[], Any]) -> None:
        super().__init__(msgspec.json.encode(now), content_type="application/json")
        self.wait = wait
        self._read = read

    def renew(self) -> None:
        """Take what is true by now."""
        self.content = msgspec.json.encode(self._read())
        self["Content-Length"] = str(len(self.content))
