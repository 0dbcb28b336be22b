"""Query parameters, and the types that several operations use."""

from __future__ import annotations

import re
from collections.abc import Collection
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

import msgspec
from drf_spectacular.utils import OpenApiParameter
from msgspec import Meta, Struct
from rest_framework.request import Request

from robots.shared.misfits import misfit_of
from robots.shared.sentences import say
from robots.shared.wire import Refusal
from teleop.api.v1.framework.problems import Problem

YEARS = range(2000, 2200)  # another year is probably a typing error; the same years as on the pages

Moment = Annotated[
    datetime, Meta(tz=True, description="RFC 3339, with its offset, such as 2026-03-02T14:30:00Z.")
]
Time = Annotated[datetime, Meta(tz=True)]  # of an answer: RFC 3339, UTC
Limit = Annotated[int, Meta(ge=1, le=200, description="The most entries to return.")]
Cursor = Annotated[str, Meta(max_length=200, description="`next` of the page before.")]
Order = Literal["newest", "oldest"]  # which entry of a list comes first


def whole_number(request: Request, name: str, default: int, most: int, least: int = 1) -> int:
    """Return a parameter that is a whole number from `least` to `most`. Raises `Problem`."""
    given = request.query_params.get(name, str(default))
    if not (re.fullmatch("[0-9]{1,19}", given) and least <= int(given) <= most):
        text = say("{name} must be a whole number from {least} to {most}.", name=name, least=least, most=most)
        raise Problem(Refusal("invalid", text, "wire"))
    return int(given)


def query_of(request: Request, struct: type[Struct]) -> Any:
    """Return the query parameters as a struct. Raises `Problem`: unknown or given twice, wrong types."""
    given: dict[str, Any] = {}
    for name, values in request.query_params.lists():
        if len(values) > 1:
            raise _invalid(say("the parameter “{name}” occurs twice", name=name[:100]))
        if "\0" in values[0]:
            raise _invalid(say("the parameter “{name}” has the character NUL", name=name[:100]))
        given[name] = values[0]
    for field in msgspec.structs.fields(struct):
        text = given.get(field.encode_name)
        # Without this check, a number would be read as seconds since 1970.
        if text is not None and "datetime" in str(field.type) and not re.match("[0-9]{4}-", text):
            raise _invalid(say("{name} is not a time such as 2026-03-02T14:30:00Z", name=field.encode_name))
    try:
        return msgspec.convert(given, struct, strict=False)
    except (msgspec.ValidationError, ValueError) as error:
        raise _invalid(misfit_of(error)) from error


def require_declared(request: Request, names: Collection[str]) -> None:
    """Refuse query parameters of other names. Raises `Problem`."""
    for name in request.query_params:
        if name not in names:
            raise _invalid(say("there is no parameter “{name}” here", name=name[:100]))


def parameters_of(struct: type[Struct]) -> list[OpenApiParameter]:
    """Return the parameters for the schema."""
    [whole], components = msgspec.json.schema_components([struct])
    found = components.get(struct.__name__, whole)
    required = found.get("required", ())
    parameters = []
    for name, schema in found["properties"].items():
        # A query parameter can be left out, but it is never null.
        kinds = [kind for kind in schema.get("anyOf", [schema]) if kind.get("type") != "null"]
        plain = {key: value for key, value in kinds[0].items() if key not in ("description", "default")}
        if schema.get("default") is not None:
            plain["default"] = schema["default"]
        words = kinds[0].get("description", schema.get("description", ""))
        parameters.append(OpenApiParameter(name, plain, description=words, required=name in required))
    return parameters


def utc(moment: datetime) -> datetime:
    """Return a moment in UTC. Raises `Problem`: its year is not in `YEARS`."""
    if moment.year not in YEARS:
        text = say("Look at the year of {time}: it is before 2000 or after 2199.", time=moment.isoformat())
        raise Problem(Refusal("wrong_year", text, "wire"))
    return moment.astimezone(UTC)


def _invalid(text: str) -> Problem:
    return Problem(Refusal("invalid", say("The query does not fit: {text}.", text=text), "wire"))
