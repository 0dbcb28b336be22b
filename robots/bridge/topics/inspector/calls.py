"""Calls of services: from fields to fields, with a time limit."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import msgspec

from robots.bridge.topics.inspector.side import Service
from robots.shared.messages.fields import fit_fields
from robots.shared.messages.packing import Detail

LARGEST_ANSWER = 16 * 1024 * 1024  # bytes

Exchange = Callable[[Service, bytes, Callable[[], None], int], bytes]  # `InspectorSide.call`

SHOWN = Detail(whole=64, first=32, text=2000)  # of an answer


def call(
    exchange: Exchange,
    service: Service,
    given: dict[str, Any],
    require_time: Callable[[], None],
    detail: Detail | None = SHOWN,
    largest: int = LARGEST_ANSWER,
) -> tuple[dict[str, Any], dict[str, int]]:
    """Call a service; return its answer, and the full lengths of shortened arrays by path.

    `detail` None: the whole answer, as rosbridge writes it.
    Raises BadField before anything is sent, Declined after.
    `require_time` is called just before the request is sent, and raises if it is too late.
    """
    now = divmod(time.time_ns(), 1_000_000_000)
    request = service.request.layout.write(fit_fields(service.request.fields, given), now)
    answer = exchange(service, request, require_time, largest)
    if detail is None:
        return msgspec.json.decode(service.response.json(answer)), {}
    return service.response.layout.read(answer, detail)
