"""Answers that wait on the event loop: hundreds of clients may wait for a change without holding threads."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from django.http import HttpResponse

from robots.shared import wire


class LongPoll(HttpResponse):
    """The current answer, which is renewed after a wait.

    `fleet.site.handler` awaits `wait` on the event loop, then calls `renew` in a thread. Another server sends
    the current answer at once, and the client asks again.
    """

    def __init__(self, now: Any, wait: Callable[[], Awaitable[None]], read: Callable[[], Any]) -> None:
        super().__init__(wire.encode(now), content_type="application/json")
        self.wait = wait
        self._read = read

    def renew(self) -> None:
        """Replace the content by the answer of now."""
        self.content = wire.encode(self._read())
        self["Content-Length"] = str(len(self.content))
