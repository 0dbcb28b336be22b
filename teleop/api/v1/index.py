"""The first address of the API: all addresses that a program can begin with."""

from __future__ import annotations

import json
from functools import cache

from msgspec import Struct

from fleet.base.version import commit, version
from teleop.api.v1.framework.operation import ApiView, operation
from teleop.api.v1.views import schema_bytes


class IndexEntry(Struct, frozen=True):
    """An address without parameters, and what each method does there."""

    address: str
    methods: dict[str, str]


class Index(Struct, frozen=True):
    """The release of the console, and the addresses that need no name or number. `schema` lists all operations."""

    version: str
    commit: str  # blank: not known
    schema: str
    reference: str  # the same for people
    entries: list[IndexEntry]


class IndexView(ApiView):
    @operation("index", "List the addresses of the API", scope=None)
    def get(self) -> Index:
        """Begin here, or with the schema."""
        return Index(version(), commit(), "/api/v1/openapi.json", "/api/v1/reference", _entries())


@cache
def _entries() -> list[IndexEntry]:
    paths = json.loads(schema_bytes())["paths"]
    return [
        IndexEntry(address, {method.upper(): one["summary"] for method, one in operations.items()})
        for address, operations in sorted(paths.items())
        if "{" not in address
    ]
