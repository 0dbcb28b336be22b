"""Pages of long lists: `next` of an answer is the `cursor` of the next request."""

from __future__ import annotations

import base64
import json
from datetime import UTC, datetime
from typing import Any, TypeVar

from django.core.exceptions import ValidationError
from django.db.models import Model, Q, QuerySet

from robots.shared.wire import Refusal
from teleop.api.v1.framework.problems import Problem

M = TypeVar("M", bound=Model)

_WRONG = Refusal("invalid", "This cursor is not from an answer of this list: begin without one.", "wire")


def encoded(*place: str | int) -> str:
    """Return a cursor that holds these values."""
    return base64.urlsafe_b64encode(json.dumps(place).encode()).decode().rstrip("=")


def decoded(cursor: str, *kinds: type) -> list[Any]:
    """Return the values of a cursor. Raises `Problem`."""
    try:
        place = json.loads(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)))
    except (ValueError, RecursionError) as error:
        raise Problem(_WRONG) from error
    if not isinstance(place, list) or [type(one) for one in place] != list(kinds):
        raise Problem(_WRONG)
    return place


def page_by_time(
    found: QuerySet[M], field: str, cursor: str | None, limit: int, *, oldest_first: bool = False
) -> tuple[list[M], str | None]:
    """Return the rows by `field`, newest first, from the cursor on, and the next cursor; None: no next page."""
    beyond, sign = ("gt", "") if oldest_first else ("lt", "-")
    if cursor:
        at, key = decoded(cursor, str, str)
        try:
            moment = datetime.fromisoformat(at).astimezone(UTC)
            found = found.filter(
                Q(**{f"{field}__{beyond}": moment}) | Q(**{field: moment, f"pk__{beyond}": key})
            )
        except (ValueError, OverflowError, ValidationError) as error:
            raise Problem(_WRONG) from error
    rows = list(found.order_by(f"{sign}{field}", f"{sign}pk")[: limit + 1])
    if len(rows) <= limit:
        return rows, None
    last = rows[limit - 1]
    return rows[:limit], encoded(getattr(last, field).isoformat(), str(last.pk))
