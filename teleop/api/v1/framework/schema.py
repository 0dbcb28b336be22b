"""The parts of the OpenAPI schema that the library cannot derive: our structs, the sign-in, the stops."""

from __future__ import annotations

from typing import Any

import msgspec
from drf_spectacular.extensions import OpenApiAuthenticationExtension, OpenApiSerializerExtension
from drf_spectacular.openapi import AutoSchema
from drf_spectacular.plumbing import ResolvedComponent
from msgspec import UNSET, Struct, UnsetType

from robots.shared.wire import MovesAlthoughStopped, StopState
from teleop.api.v1.framework.problems import CONTENT_TYPE, OF_THE_DOOR, ProblemDetails

_SLUG = {"type": "string", "pattern": "^[-a-zA-Z0-9_]+$"}  # as the library describes `<slug:...>`
REFERENCE = "#/components/schemas/{name}"


class OperationSchema(AutoSchema):
    """The schema of an operation: its view says the tag."""

    def get_tags(self) -> list[str]:
        return [self.view.tag]  # type: ignore[attr-defined]  # of `ApiView`


class StructSchema(OpenApiSerializerExtension):  # type: ignore[no-untyped-call]
    """The schema of a msgspec struct and of the structs in its fields: JSON Schema, as in OpenAPI 3.1."""

    target_class = "msgspec.Struct"
    match_subclasses = True

    def get_name(self, auto_schema: Any, direction: Any) -> str:
        """Return the component's name."""
        return str(self.target.__name__)

    def map_serializer(self, auto_schema: Any, direction: Any) -> Any:
        """Return the struct's schema. The structs in its fields become components of their own."""
        _, found = msgspec.json.schema_components([self.target], ref_template=REFERENCE)
        own = found.pop(self.target.__name__)
        structs = _structs_in(msgspec.inspect.type_info(self.target))
        for name, schema in found.items():
            component = ResolvedComponent(  # type: ignore[no-untyped-call]
                name=name, type=ResolvedComponent.SCHEMA, object=structs.get(name, name), schema=schema
            )
            auto_schema.registry.register_on_missing(component)
        return own


def _structs_in(info: Any, found: dict[str, type] | None = None) -> dict[str, type]:
    """Return the structs that a type contains, by their names: the schema registers them by class."""
    found = {} if found is None else found
    if isinstance(info, msgspec.inspect.StructType) and info.cls.__name__ not in found:
        found[info.cls.__name__] = info.cls
        for field in info.fields:
            _structs_in(field.type, found)
    for part in ("type", "item_type", "key_type", "value_type"):
        if inner := getattr(info, part, None):
            _structs_in(inner, found)
    for inner in getattr(info, "types", ()) or getattr(info, "item_types", ()):
        _structs_in(inner, found)
    return found


class TokenScheme(OpenApiAuthenticationExtension):  # type: ignore[no-untyped-call]
    """The header with the token."""

    target_class = "teleop.api.v1.framework.authentication.TokenAuthentication"
    name = "token"

    def get_security_definition(self, auto_schema: Any) -> dict[str, str]:
        """Return the scheme."""
        return {"type": "http", "scheme": "bearer", "description": "Made on the page Your account."}


class SessionScheme(OpenApiAuthenticationExtension):  # type: ignore[no-untyped-call]
    """The cookie of a browser's session.

    Its real name has a suffix, so that several consoles can share a host.
    """

    target_class = "rest_framework.authentication.SessionAuthentication"
    name = "session"
    priority = 1  # before the library's own

    def get_security_definition(self, auto_schema: Any) -> dict[str, str]:
        """Return the scheme."""
        return {"type": "apiKey", "in": "cookie", "name": "fleet_session"}


class StopResult(Struct, frozen=True):
    """The outcome of a stop of one robot: the stop and its number, with which it is cleared; or a refusal."""

    number: int | UnsetType = UNSET
    stop: StopState | UnsetType = UNSET
    moves_although_stopped: MovesAlthoughStopped | UnsetType = UNSET
    code: str | UnsetType = UNSET  # of the refusal, as `text` and `rule`
    text: str | UnsetType = UNSET
    rule: str | UnsetType = UNSET
    pending: bool = False  # the stop is delivered as soon as possible


class StopResults(Struct, frozen=True):
    """The outcome of a stop, by robot."""

    robots: dict[str, StopResult]


def with_stops(result: dict[str, Any], generator: Any, **_options: Any) -> dict[str, Any]:
    """Add the stops. REST framework does not serve them: only sign-in and origin may refuse a stop."""
    _, found = msgspec.json.schema_components([StopResults, ProblemDetails], ref_template=REFERENCE)
    result["components"]["schemas"] |= found
    one = {"name": "slug", "in": "path", "required": True, "schema": _SLUG}
    addresses: list[tuple[str, str, list[Any]]] = [
        ("/stop", "stop_all", []),
        ("/robots/{slug}/stop", "stop", [one]),
    ]
    for address, name, parameters in addresses:
        answers = {
            "200": _answer("Stopped.", "StopResults"),
            "202": _answer("Some are pending: the stop is delivered as soon as possible.", "StopResults"),
            "502": _answer("One or more robots were not reached.", "StopResults"),
            **{
                str(code): _answer("refused", "ProblemDetails", CONTENT_TYPE)
                for code in (*OF_THE_DOOR, 401, 403, 404, 405)
            },
        }
        result["paths"][f"/api/v1{address}"] = {
            "post": {
                "operationId": name,
                "summary": "Emergency stop: latched",
                "description": "No body is read. Any token of a person who may see the robot.",
                "tags": ["stop"],
                "parameters": parameters,
                "security": [{"token": []}, {"session": []}],
                "responses": answers,
            }
        }
    _plain_tuples(result["components"]["schemas"])
    return result


def _plain_tuples(schema: Any) -> None:
    """Describe a tuple of equal types as an array of fixed length, and name the items of every array.

    Client generators do not support `items: false`, and leave out a schema with an array without items.
    """
    if isinstance(schema, dict):
        if schema.get("items") is False:
            first, *others = schema.pop("prefixItems")
            if any(other != first for other in others):
                raise ValueError(f"a tuple of different types is for no client: {schema}")
            schema["items"] = first
        if schema.get("type") == "array":
            schema.setdefault("items", {})
        for inner in schema.values():
            _plain_tuples(inner)
    elif isinstance(schema, list):
        for inner in schema:
            _plain_tuples(inner)


def _answer(words: str, name: str, kind: str = "application/json") -> dict[str, Any]:
    return {"description": words, "content": {kind: {"schema": {"$ref": REFERENCE.format(name=name)}}}}
