"""The page with the reference of the API, and the schema."""

from __future__ import annotations

from functools import cache

from csp.decorators import csp_update
from django.contrib.auth.decorators import login_not_required
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.views.decorators.http import require_safe
from drf_spectacular.generators import SchemaGenerator
from drf_spectacular.renderers import OpenApiJsonRenderer

import teleop.api.v1.framework.schema  # noqa: F401  # extends the description


@csp_update({"img-src": ["data:"]})  # the library's icons
@require_safe
def reference(request: HttpRequest) -> HttpResponse:
    """Show the page with every operation. There the signed-in person can try them."""
    return render(request, "api/reference.html")


@login_not_required
@require_safe
def schema(_request: HttpRequest) -> HttpResponse:
    """Return the OpenAPI schema, to anybody."""
    return HttpResponse(schema_bytes(), content_type=OpenApiJsonRenderer.media_type)


@cache
def schema_bytes() -> bytes:
    """Return the OpenAPI schema as JSON."""
    # Not built for each request: this takes longer than a page, and strangers may request it.
    described = SchemaGenerator().get_schema(request=None, public=True)  # type: ignore[no-untyped-call]
    return bytes(OpenApiJsonRenderer().render(described, renderer_context={}))
