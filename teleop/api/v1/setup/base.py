"""Base of the views of this folder: operations of one shape, staff only, robots of a token, entity tags."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterable

import msgspec
from django.core.exceptions import NON_FIELD_ERRORS, ValidationError
from drf_spectacular.utils import OpenApiParameter
from msgspec import Struct
from rest_framework.request import Request
from rest_framework.response import Response

from fleet.accounts.models import User
from robots.access.models import RobotGroup
from robots.registry.models import Robot
from robots.wire import Refusal
from teleop.api.v1.door.operation import ApiView
from teleop.api.v1.door.problems import NOT_FOUND, Problem
from teleop.api.v1.door.versions import etag_of, version_seen

IF_MATCH = OpenApiParameter(
    "If-Match", str, OpenApiParameter.HEADER, required=True, description="The ETag as you read it."
)
_STAFF_ONLY = Refusal("permission_denied", "This is for staff and their service accounts.", "account")
_CHANGED = Refusal("changed", "It was changed meanwhile: read it again.", "wire")
_OF_ALL_ROBOTS = Refusal(
    "other_robots", "This is about robots that the token does not serve: use another token.", "account"
)


class SetupView(ApiView):
    """Base of these views."""

    def staff(self) -> User:
        """Return the person. Raises `Problem`: they are no staff."""
        if not self.person.is_staff:
            raise Problem(_STAFF_ONLY)
        return self.person

    def serves(self, robots: Iterable[Robot]) -> bool:
        """Return whether the token may be used for all these robots."""
        token = self.token
        return token is None or all(token.serves(robot.id) for robot in robots)

    def require_served(self, robots: Iterable[Robot]) -> None:
        """Raise `Problem` if the token does not serve all these robots."""
        if not self.serves(robots):
            raise Problem(_OF_ALL_ROBOTS)

    def require_all_robots(self) -> None:
        """Raise `Problem` if the token is bound to robots: what is asked for concerns all."""
        if self.token is not None and self.token.robots:
            raise Problem(_OF_ALL_ROBOTS)

    def named_robots(self, slugs: Collection[str]) -> list[Robot]:
        """Return the robots with these slugs. Raises `Problem`: not found."""
        return [self.robot(slug) for slug in dict.fromkeys(slugs)]

    def tagged(self, entry: Struct, status: int = 200, location: str = "") -> Response:
        """Answer an entry with its ETag."""
        headers = {"ETag": etag_of(mark_of(entry))} | ({"Location": location} if location else {})
        return Response(msgspec.to_builtins(entry), status, headers=headers)


def named_groups(slugs: Collection[str]) -> list[RobotGroup]:
    """Return the robot groups with these slugs. Raises `Problem`: not found."""
    found = {group.slug: group for group in RobotGroup.objects.filter(slug__in=slugs)}
    if not set(slugs) <= found.keys():
        raise Problem(NOT_FOUND)
    return list(found.values())


def mark_of(entry: Struct) -> int:
    """Return a number that differs after each change of the entry."""
    return zlib.crc32(msgspec.json.encode(entry)) % 10**9


def require_unchanged(request: Request, entry: Struct) -> None:
    """Raise `Problem` if the client did not read the entry as it is now."""
    if version_seen(request) != mark_of(entry):
        raise Problem(_CHANGED)


def invalid(error: ValidationError) -> Problem:
    """Return a model's or form's faults as one problem that names the fields."""
    fields = error.message_dict if hasattr(error, "error_dict") else {}
    texts = [
        " ".join(words) if name == NON_FIELD_ERRORS else f"{name}: {' '.join(words)}"
        for name, words in fields.items()
    ]
    return Problem(Refusal("invalid", " ".join(texts or error.messages), "wire"))
