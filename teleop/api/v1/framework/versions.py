"""ETag, If-Match, If-None-Match: no client overwrites an unseen change, or loads a version twice."""

from __future__ import annotations

import re

from django.http import HttpResponseBase, HttpResponseNotModified
from django.utils.http import parse_etags
from drf_spectacular.utils import OpenApiParameter
from rest_framework.request import Request

from robots.shared.wire import Refusal
from teleop.api.v1.framework.problems import Problem

IF_MATCH = OpenApiParameter(
    "If-Match", str, OpenApiParameter.HEADER, required=True, description="The ETag as you read it."
)
_MISSING = Refusal(
    "if_match_missing",
    "Send the header If-Match with the ETag that you read, so that you overwrite no change by others.",
    "wire",
)


def etag_of(version: int) -> str:
    """Return the entity tag of a version."""
    return f'"{version}"'


def version_seen(request: Request) -> int:
    """Return the version that the client read; -1: not a tag of ours. Raises `Problem`: no tag was sent."""
    given = request.headers.get("If-Match", "").strip()
    if not given or given == "*":
        raise Problem(_MISSING)
    match = re.fullmatch('"([0-9]{1,9})"', given)
    return int(match[1]) if match else -1


def unchanged(request: Request, tag: str) -> HttpResponseBase | None:
    """Return the answer 304 if the client already has the version with this tag (If-None-Match); else None.

    A weak tag is accepted, too: a proxy that compresses makes tags weak.
    """
    wanted = parse_etags(request.headers.get("If-None-Match", ""))
    if "*" not in wanted and tag.removeprefix("W/") not in (one.removeprefix("W/") for one in wanted):
        return None
    answer = HttpResponseNotModified()
    answer["ETag"] = tag
    return answer
