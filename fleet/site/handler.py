"""Django's handler, with one change of thread for each request."""

from __future__ import annotations

from asgiref.sync import sync_to_async
from django.core.handlers.asgi import ASGIHandler
from django.http import HttpRequest
from django.http.response import HttpResponseBase

from robots.processes.scheduling import prefer_stop_thread


class OneThreadHandler(ASGIHandler):
    """Run middleware and view, which are all synchronous here, in one call on one thread.

    Django's own handler calls them by way of the event loop: the request waits there three times for drive input and
    other requests. A stop by HTTP took twice as long.
    """

    def load_middleware(self, is_async: bool = False) -> None:
        """Load the chain of middleware for a thread."""
        super().load_middleware(is_async=False)

    async def get_response_async(self, request: HttpRequest) -> HttpResponseBase:
        """Answer the request on its thread."""
        return await sync_to_async(self._answer)(request)

    def _answer(self, request: HttpRequest) -> HttpResponseBase:
        prefer_stop_thread()  # the process that drives answers stops alone; the pages process may prefer nobody
        return self.get_response(request)
