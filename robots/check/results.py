"""Results of a check of a robot."""

from __future__ import annotations

from typing import Literal

from django.utils.translation import gettext as _
from msgspec import Struct

Level = Literal["ok", "warn", "fail"]
OK: Level = "ok"
WARN: Level = "warn"
FAIL: Level = "fail"


class Check(Struct, frozen=True):
    """One result. `advice` is the remedy; "" if none is needed."""

    name: str
    level: Level
    text: str
    advice: str = ""


def listed(names: list[str]) -> str:
    """Return names as people list them."""
    if not names:
        return _("nothing")
    *first, last = names
    return _("%(first)s and %(last)s") % {"first": ", ".join(first), "last": last} if first else last
