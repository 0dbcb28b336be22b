"""The page with the reference of the API."""

from __future__ import annotations

from csp.decorators import csp_update
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe


@csp_update({"img-src": ["data:"]})  # the library's icons
@require_safe
def reference(request: HttpRequest) -> HttpResponse:
    """Show every operation, and try it as the person who is signed in."""
    return render(request, "api/reference.html")
