"""Base of the views in this folder: kinds of operations, checks of staff and of a token's robots, ETags."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

from django.core.exceptions import ValidationError
from django.db.models import Model
from msgspec import Struct
from rest_framework.response import Response

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from robots.access.models import RobotGroup
from robots.registry.models import Robot
from robots.shared import wire
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import ApiView, operation
from teleop.api.v1.framework.problems import NOT_FOUND, Problem, fault_refusal
from teleop.api.v1.framework.versions import IF_MATCH, etag_of, version_seen

Entry = TypeVar("Entry", bound=Model)
# The kinds of most operations here. Lists set `refuses=()`: they have no 404.
manages = partial(operation, scope=Scope.MANAGE, refuses=(404,))
makes = partial(manages, status=201)
edits = partial(manages, refuses=(404, 412, 428), parameters=[IF_MATCH])

_STAFF_ONLY = Refusal("permission_denied", "This is for staff and their service accounts.", "account")
_CHANGED = Refusal("changed", "Somebody changed this entry after you read it: read it again.", "wire")


class SetupView(ApiView):
    """Base of these views."""

    def concerned(self, *_path: Any, **asked: Any) -> Iterable[Robot]:
        return [self.robot(asked["slug"])] if "slug" in asked else ()

    def staff(self) -> User:
        """Return the person. Raises `Problem`: the person is not staff."""
        if not self.person.is_staff:
            raise Problem(_STAFF_ONLY)
        return self.person

    def named_robots(self, slugs: Collection[str]) -> list[Robot]:
        """Return the robots with these slugs. Raises `Problem`: not found."""
        return [self.robot(slug) for slug in dict.fromkeys(slugs)]

    def tagged(self, entry: Struct, status: int = 200, location: str = "") -> Response:
        """Return the response with an entry and its ETag."""
        headers = {"ETag": etag_of(mark_of(entry))} | ({"Location": location} if location else {})
        return Response(wire.to_builtins(entry), status, headers=headers)

    def shown_once(self, entry: Struct, location: str = "") -> Response:
        """Return the response with a new entry and its secret. Caches must not store this response."""
        headers = {"Cache-Control": "no-store"} | ({"Location": location} if location else {})
        return Response(wire.to_builtins(entry), 201, headers=headers)

    def require_unchanged(self, entry: Struct) -> None:
        """Raise `Problem` if the entry was changed after the client read it (If-Match)."""
        if version_seen(self.request) != mark_of(entry):
            raise Problem(_CHANGED)

    def group(self, slug: str) -> RobotGroup:
        """Return a robot group, for staff whose token serves all its robots. Raises `Problem`."""
        self.staff()
        [group] = named_groups([slug])
        self.require_served(group.robots.all())
        return group


def locked(entry: Entry) -> Entry:
    """Return the entry as it is stored now, locked: nobody else can change it until the transaction ends."""
    return type(entry)._default_manager.select_for_update(no_key=True).get(pk=entry.pk)


def named_groups(slugs: Collection[str]) -> list[RobotGroup]:
    """Return the robot groups with these slugs. Raises `Problem`: not found."""
    found = {group.slug: group for group in RobotGroup.objects.filter(slug__in=slugs)}
    if not set(slugs) <= found.keys():
        raise Problem(NOT_FOUND)
    return list(found.values())


def mark_of(entry: Struct) -> int:
    """Return a number that differs after each change of the entry."""
    return zlib.crc32(wire.encode(entry)) % 10**9


@contextmanager
def faults_named() -> Iterator[None]:
    """Turn the faults that a model or a form finds into one `Problem` that names the fields."""
    try:
        yield
    except ValidationError as error:
        raise Problem(fault_refusal(error)) from error
