"""Mark views whose POST may take time from people: nothing is done before somebody has seen who loses what.

`fleet.bookings.losses` is above most of these views, so it puts its door here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, wraps
from typing import Any, TypeVar

from django.http import HttpRequest, HttpResponseBase

View = TypeVar("View", bound=Callable[..., Any])
Door = Callable[[HttpRequest, Callable[[], HttpResponseBase]], HttpResponseBase]

_doors: list[Door] = []


def use_door(door: Door) -> None:
    """Let each POST of a marked view pass this door."""
    _doors[:] = [door]


def may_take_time(view: View) -> View:
    """Mark a view: its POST passes the door."""

    @wraps(view)
    def passing(request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponseBase:
        answer = partial(view, request, *args, **kwargs)
        return _doors[0](request, answer) if request.method == "POST" and _doors else answer()

    return passing  # type: ignore[return-value]  # the same arguments
