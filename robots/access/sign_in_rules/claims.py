"""Claims of an OpenID Connect provider. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def values_of(claims: Mapping[str, Any], name: str) -> frozenset[str]:
    """Return the values of a claim as texts. Dots in the name lead into objects; a list has several values."""
    found: Any = claims
    if name in claims:  # some providers use addresses with dots as names
        found = claims[name]
    else:
        for part in name.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
    if isinstance(found, list):
        return frozenset(_text(one) for one in found if isinstance(one, str | int))
    return frozenset([_text(found)] if isinstance(found, str | int) else ())


def _text(value: str | int) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
