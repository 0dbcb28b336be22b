"""Every other address of the API."""

from __future__ import annotations

from typing import Any

from django.http import HttpResponseRedirect
from rest_framework.request import Request

from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import ApiView
from teleop.api.v1.framework.problems import Problem

_NO_ADDRESS = Refusal("not_found", "There is no such address.", "wire")


class SameMethod(HttpResponseRedirect):
    """A redirect that keeps method and body."""

    status_code = 308


class UnknownAddress(ApiView):
    """404, or a redirect to the address without its last slash."""

    def initial(self, request: Request, *args: Any, **kwargs: Any) -> None:
        super().initial(request, *args, **kwargs)
        raise Problem(_NO_ADDRESS)

    def dispatch(self, request: Any, *args: Any, **kwargs: Any) -> Any:
        """Redirect to the address without its last slash."""
        if request.path.endswith("/") and kwargs["address"].strip("/"):
            query = request.META.get("QUERY_STRING", "")
            return SameMethod(request.path.rstrip("/") + (f"?{query}" if query else ""))
        return super().dispatch(request, *args, **kwargs)
