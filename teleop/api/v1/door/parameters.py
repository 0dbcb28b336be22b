"""Query parameters."""

from __future__ import annotations

import re

from rest_framework.request import Request

from robots.wire import Refusal
from teleop.api.v1.door.problems import Problem


def whole_number(request: Request, name: str, default: int, most: int, least: int = 1) -> int:
    """Return a parameter that is a whole number from `least` to `most`. Raises `Problem`."""
    given = request.query_params.get(name, str(default))
    if not (re.fullmatch("[0-9]{1,19}", given) and least <= int(given) <= most):
        text = f"{name} must be a whole number from {least} to {most}."
        raise Problem(Refusal("invalid", text, "wire"))
    return int(given)
