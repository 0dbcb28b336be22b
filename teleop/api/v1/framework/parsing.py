"""Bodies of requests: they are read as bytes, and the operation decodes them."""

from __future__ import annotations

import json
from typing import IO, Any

import msgspec
from msgspec import Struct
from rest_framework.parsers import BaseParser
from rest_framework.request import Request

from robots.shared.misfits import misfit_of
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.problems import Problem

MOST_BYTES = 64 * 1024
DEEPEST = 32  # levels of a body

_TOO_DEEP = Refusal(
    "too_deep", say("The body has more than {most} levels.", most=DEEPEST), "wire", {"limit": DEEPEST}
)
_HAS_NUL = Refusal("invalid", "The body has a text with the character NUL: leave it out.", "wire")


class Nothing(Struct, frozen=True, forbid_unknown_fields=True):
    """The body of an operation that asks for none."""


class Unparsed(BaseParser):
    """Read a JSON body as bytes."""

    media_type = "application/json"

    def parse(self, stream: IO[Any], media_type: Any = None, parser_context: Any = None) -> Any:
        """Return the bytes."""
        return stream.read()


def decoded(request: Request, struct: type[Struct]) -> Any:
    """Return the body as a struct. Raises `Problem`: too large, no JSON, duplicate or unknown fields, wrong types."""
    raw = request.data if isinstance(request.data, bytes) else b""
    if len(raw) > MOST_BYTES:
        text = say("The body has {bytes} bytes; at most {most} are taken.", bytes=len(raw), most=MOST_BYTES)
        raise Problem(Refusal("too_large", text, "wire", {"bytes": len(raw), "limit_bytes": MOST_BYTES}))
    try:
        _require_plain(json.loads(raw.decode() or "{}", object_pairs_hook=_without_duplicates))
        return msgspec.json.decode(raw or b"{}", type=struct)
    except UnicodeDecodeError as error:
        raise Problem(Refusal("not_utf8", "The body is not UTF-8.", "wire")) from error
    except RecursionError as error:
        raise Problem(_TOO_DEEP) from error
    except msgspec.ValidationError as error:
        raise Problem(
            Refusal("invalid", say("The body does not fit: {error}", error=misfit_of(error)), "wire")
        ) from error
    except ValueError as error:
        raise Problem(
            Refusal("not_json", say("The body is not JSON: {error}", error=misfit_of(error)), "wire")
        ) from error


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            # Half of a surrogate pair cannot be sent in the answer.
            shown = name[:100].encode(errors="replace").decode()
            raise Problem(
                Refusal(
                    "duplicate_field", say("The body has the field “{shown}” twice.", shown=shown), "wire"
                )
            )
        found[name] = value
    return found


def _require_plain(value: Any, level: int = 0) -> None:
    if level > DEEPEST:
        raise Problem(_TOO_DEEP)
    if isinstance(value, str) and "\0" in value:
        raise Problem(_HAS_NUL)
    if isinstance(value, dict):
        value = [*value, *value.values()]
    for inner in value if isinstance(value, list) else ():
        _require_plain(inner, level + 1)
