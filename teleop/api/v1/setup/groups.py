"""Robot groups with the roles on them, and qualifications that robots demand. For staff."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal, TypeVar

from django.core.exceptions import ValidationError
from django.db import transaction
from msgspec import Meta, Struct
from rest_framework.request import Request
from rest_framework.response import Response

from fleet.accounts.models import User
from fleet.accounts.tokens.models import Scope
from robots.access import services
from robots.access.models import GroupRole, Qualification, RobotGroup
from robots.access.pages.forms import free_slug
from robots.registry.models import Robot, Role
from robots.wire import Refusal
from teleop.api.v1.door.operation import operation
from teleop.api.v1.door.problems import NOT_FOUND, Problem
from teleop.api.v1.setup.base import IF_MATCH, SetupView, invalid, named_groups, require_unchanged

Name = Annotated[str, Meta(min_length=1, max_length=80)]
Slugs = Annotated[list[str], Meta(max_length=1000)]
GivenRole = Literal["observer", "operator", "supervisor"]
Entry = TypeVar("Entry", RobotGroup, Qualification)

_NO_ACCOUNT = Refusal("not_found", "There is no open account with this user name.", "wire")


class Holder(Struct, frozen=True):
    """A person with a role."""

    username: str
    role: GivenRole


class GroupEntry(Struct, frozen=True):
    """A robot group, with the people who have a role on all its robots."""

    slug: str
    name: str
    robots: list[str]
    roles: list[Holder]


class GroupList(Struct, frozen=True):
    """Robot groups, by name."""

    groups: list[GroupEntry]


class GroupRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A robot group: name and robots (slugs)."""

    name: Name
    robots: Slugs = []


class RoleRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A role, in place of any other of this person there."""

    role: GivenRole


class QualificationDetail(Struct, frozen=True):
    """A qualification, and the robots and groups that demand it."""

    slug: str
    name: str
    description: str
    robots: list[str]
    groups: list[str]


class QualificationList(Struct, frozen=True):
    """Qualifications, by name."""

    qualifications: list[QualificationDetail]


class QualificationRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A qualification; `robots` and `groups` (slugs) demand it."""

    name: Name
    description: Annotated[str, Meta(max_length=300)] = ""  # where and how people get it
    robots: Slugs = []
    groups: Slugs = []


class GroupsBase(SetupView):
    """Base of the views of robot groups. A bound token sees and changes those whose robots it serves, all of them."""

    def group(self, slug: str) -> RobotGroup:
        """Return one of them. Raises `Problem`: not found."""
        self.staff()
        [group] = named_groups([slug])
        self.require_served(group.robots.all())
        return group

    def save_group(self, group: RobotGroup, body: GroupRequest) -> None:
        """Save a group. Raises `Problem`."""
        robots = self.named_robots(body.robots)
        group.name, group.slug = body.name, group.slug or free_slug(RobotGroup, body.name)
        _saved(lambda: services.group_save(group=group, robots=robots, actor=self.staff()))


class GroupsView(GroupsBase):
    """`/robot-groups`."""

    @operation("groups_list", "List robot groups", scope=Scope.MANAGE, answer=GroupList, tag="groups")
    def get(self, _request: Request) -> GroupList:
        """By staff."""
        self.staff()
        found = RobotGroup.objects.prefetch_related("robots")
        return GroupList([_group(one) for one in found if self.serves(one.robots.all())])

    @operation(
        "groups_make",
        "Make a robot group",
        scope=Scope.MANAGE,
        body=GroupRequest,
        answer=GroupEntry,
        status=201,
        refuses=(404,),
        keyed=True,
        tag="groups",
    )
    def post(self, _request: Request, body: GroupRequest) -> Response:
        """By staff."""
        self.staff()
        group = RobotGroup()
        self.save_group(group, body)
        return self.tagged(_group(group), 201, f"/api/v1/robot-groups/{group.slug}")


class GroupView(GroupsBase):
    """`/robot-groups/{slug}`."""

    @operation(
        "groups_read",
        "Read a robot group",
        scope=Scope.MANAGE,
        answer=GroupEntry,
        refuses=(404,),
        tag="groups",
    )
    def get(self, _request: Request, slug: str) -> Response:
        """By staff."""
        return self.tagged(_group(self.group(slug)))

    @operation(
        "groups_change",
        "Change a robot group",
        scope=Scope.MANAGE,
        body=GroupRequest,
        answer=GroupEntry,
        refuses=(404, 412, 428),
        tag="groups",
        parameters=[IF_MATCH],
    )
    def put(self, request: Request, slug: str, body: GroupRequest) -> Response:
        """By staff. Roles and bookings follow at once."""
        with transaction.atomic():
            group = _locked(self.group(slug))
            require_unchanged(request, _group(group))
            self.save_group(group, body)
        return self.tagged(_group(self.group(slug)))

    @operation(
        "groups_delete",
        "Delete a robot group",
        scope=Scope.MANAGE,
        status=204,
        refuses=(404,),
        tag="groups",
    )
    def delete(self, _request: Request, slug: str) -> None:
        """Its robots stay; roles, courses and policies by it end."""
        services.group_delete(group=self.group(slug), actor=self.staff())


class GroupRoleView(GroupsBase):
    """`/robot-groups/{slug}/roles/{username}`."""

    @operation(
        "groups_role_set",
        "Give a person a role on a group’s robots",
        scope=Scope.MANAGE,
        body=RoleRequest,
        answer=Holder,
        refuses=(404,),
        tag="groups",
    )
    def put(self, _request: Request, slug: str, username: str, body: RoleRequest) -> Holder:
        """By staff."""
        group, person = self.group(slug), account_named(username)
        services.group_role_set(group=group, user=person, role=Role(body.role), actor=self.staff())
        return Holder(person.username, body.role)

    @operation(
        "groups_role_remove",
        "Take a person’s role on a group’s robots away",
        scope=Scope.MANAGE,
        status=204,
        refuses=(404,),
        tag="groups",
    )
    def delete(self, _request: Request, slug: str, username: str) -> None:
        """Roles by courses and on single robots stay."""
        group, person = self.group(slug), account_named(username)
        services.group_role_set(group=group, user=person, role=None, actor=self.staff())


class RobotRolesView(SetupView):
    """`/registry/{slug}/roles/{username}`."""

    @operation(
        "registry_role_set",
        "Give a person a role on a robot",
        scope=Scope.MANAGE,
        body=RoleRequest,
        answer=Holder,
        refuses=(404,),
        tag="registry",
    )
    def put(self, _request: Request, slug: str, username: str, body: RoleRequest) -> Holder:
        """By staff."""
        staff, robot, person = self.staff(), self.robot(slug), account_named(username)
        services.role_set(robot=robot, user=person, role=Role(body.role), actor=staff)
        return Holder(person.username, body.role)

    @operation(
        "registry_role_remove",
        "Take a person’s role on a robot away",
        scope=Scope.MANAGE,
        status=204,
        refuses=(404,),
        tag="registry",
    )
    def delete(self, _request: Request, slug: str, username: str) -> None:
        """Roles by courses and groups stay."""
        staff, robot, person = self.staff(), self.robot(slug), account_named(username)
        services.role_set(robot=robot, user=person, role=None, actor=staff)


class QualificationsBase(SetupView):
    """Base of the views of qualifications: as for groups."""

    def qualification(self, slug: str) -> Qualification:
        """Return one of them. Raises `Problem`: not found."""
        self.staff()
        found = Qualification.objects.filter(slug=slug).first()
        if found is None:
            raise Problem(NOT_FOUND)
        self.require_served(_demanding(found))
        return found

    def save_qualification(self, entry: Qualification, body: QualificationRequest) -> None:
        """Save a qualification. Raises `Problem`."""
        robots, groups = self.named_robots(body.robots), named_groups(body.groups)
        for group in groups:
            self.require_served(group.robots.all())
        entry.name, entry.description = body.name, body.description
        entry.slug = entry.slug or free_slug(Qualification, body.name)
        staff = self.staff()
        _saved(
            lambda: services.qualification_save(
                qualification=entry, robots=robots, groups=groups, actor=staff
            )
        )


class QualificationsView(QualificationsBase):
    """`/qualifications`."""

    @operation(
        "qualifications_list",
        "List qualifications",
        scope=Scope.MANAGE,
        answer=QualificationList,
        tag="groups",
    )
    def get(self, _request: Request) -> QualificationList:
        """By staff."""
        self.staff()
        found = Qualification.objects.prefetch_related("robots", "groups__robots")
        return QualificationList([_qualification(one) for one in found if self.serves(_demanding(one))])

    @operation(
        "qualifications_make",
        "Make a qualification",
        scope=Scope.MANAGE,
        body=QualificationRequest,
        answer=QualificationDetail,
        status=201,
        refuses=(404,),
        keyed=True,
        tag="groups",
    )
    def post(self, _request: Request, body: QualificationRequest) -> Response:
        """By staff. From now on only people who hold it drive these robots."""
        self.staff()
        entry = Qualification()
        self.save_qualification(entry, body)
        return self.tagged(_qualification(entry), 201, f"/api/v1/qualifications/{entry.slug}")


class QualificationView(QualificationsBase):
    """`/qualifications/{slug}`."""

    @operation(
        "qualifications_read",
        "Read a qualification",
        scope=Scope.MANAGE,
        answer=QualificationDetail,
        refuses=(404,),
        tag="groups",
    )
    def get(self, _request: Request, slug: str) -> Response:
        """By staff."""
        return self.tagged(_qualification(self.qualification(slug)))

    @operation(
        "qualifications_change",
        "Change a qualification",
        scope=Scope.MANAGE,
        body=QualificationRequest,
        answer=QualificationDetail,
        refuses=(404, 412, 428),
        tag="groups",
        parameters=[IF_MATCH],
    )
    def put(self, request: Request, slug: str, body: QualificationRequest) -> Response:
        """By staff. People who lack it lose control of robots that demand it now."""
        with transaction.atomic():
            entry = _locked(self.qualification(slug))
            require_unchanged(request, _qualification(entry))
            self.save_qualification(entry, body)
        return self.tagged(_qualification(self.qualification(slug)))

    @operation(
        "qualifications_delete",
        "Delete a qualification",
        scope=Scope.MANAGE,
        status=204,
        refuses=(404,),
        tag="groups",
    )
    def delete(self, _request: Request, slug: str) -> None:
        """No robot demands it any more, and nobody holds it."""
        services.qualification_delete(qualification=self.qualification(slug), actor=self.staff())


def account_named(username: str) -> User:
    """Return the open account with this name. Raises `Problem`."""
    found = User.objects.filter(username=username.replace("\0", ""), is_active=True).first()
    if found is None:
        raise Problem(_NO_ACCOUNT)
    return found


def _locked(entry: Entry) -> Entry:
    return type(entry)._default_manager.select_for_update().get(pk=entry.pk)


def _saved(save: Callable[[], Any]) -> None:
    try:
        save()
    except ValidationError as error:
        raise invalid(error) from error


def _demanding(entry: Qualification) -> list[Robot]:
    """Return the robots that demand it, themselves or by a group."""
    return [*entry.robots.all(), *(robot for group in entry.groups.all() for robot in group.robots.all())]


def _group(group: RobotGroup) -> GroupEntry:
    roles = GroupRole.objects.filter(group=group).select_related("user").order_by("user__username")
    return GroupEntry(
        group.slug,
        group.name,
        sorted(robot.slug for robot in group.robots.all()),
        [Holder(one.user.username, one.role) for one in roles],  # type: ignore[arg-type]  # those that are given
    )


def _qualification(entry: Qualification) -> QualificationDetail:
    return QualificationDetail(
        entry.slug,
        entry.name,
        entry.description,
        sorted(robot.slug for robot in entry.robots.all()),
        sorted(group.slug for group in entry.groups.all()),
    )
