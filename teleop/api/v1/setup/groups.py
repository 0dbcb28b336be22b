"""Robot groups with the roles on them, and qualifications that robots demand. For staff."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from django.db import transaction
from django.shortcuts import get_object_or_404
from msgspec import Meta, Struct
from rest_framework.response import Response

from fleet.accounts.models import User
from robots.access import services
from robots.access.models import GroupRole, Qualification, RobotGroup
from robots.registry.models import Robot, Role
from robots.registry.selectors import free_slug
from robots.shared.wire import Refusal
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.setup.base import SetupView, edits, faults_named, locked, makes, manages, named_groups

Name = Annotated[str, Meta(min_length=1, max_length=80)]
Slugs = Annotated[list[str], Meta(max_length=1000)]
GivenRole = Literal["observer", "operator", "supervisor"]

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
    """Base of the views of robot groups.

    A token sees and changes only groups of which it serves all robots.
    """

    tag = "groups"

    def concerned(self, slug: str = "", body: Any = None, **_asked: Any) -> Iterable[Robot]:
        found = list(self.group(slug).robots.all()) if slug else []
        return found + self.named_robots(getattr(body, "robots", ()))

    def save_group(self, group: RobotGroup, body: GroupRequest) -> None:
        """Save a group. Raises `Problem`."""
        robots = self.named_robots(body.robots)
        group.name, group.slug = body.name, group.slug or free_slug(RobotGroup, body.name)
        with faults_named():
            services.group_save(group=group, robots=robots, actor=self.staff())


class GroupsView(GroupsBase):
    @manages("groups_list", "List robot groups", refuses=())
    def get(self) -> GroupList:
        """For staff."""
        self.staff()
        found = RobotGroup.objects.prefetch_related("robots")
        return GroupList([_group(one) for one in found if self.serves(one.robots.all())])

    @makes("groups_make", "Make a robot group", answer=GroupEntry, keyed=True)
    def post(self, body: GroupRequest) -> Response:
        """For staff."""
        self.staff()
        group = RobotGroup()
        self.save_group(group, body)
        return self.tagged(_group(group), 201, f"/api/v1/robot-groups/{group.slug}")


class GroupView(GroupsBase):
    @manages("groups_read", "Read a robot group", answer=GroupEntry)
    def get(self, slug: str) -> Response:
        """For staff."""
        return self.tagged(_group(self.group(slug)))

    @edits("groups_change", "Change a robot group", takes_time=True, answer=GroupEntry)
    def put(self, slug: str, body: GroupRequest) -> Response:
        """For staff. Roles and bookings follow at once."""
        with transaction.atomic():
            group = locked(self.group(slug))
            self.require_unchanged(_group(group))
            self.save_group(group, body)
        return self.tagged(_group(self.group(slug)))

    @manages("groups_delete", "Delete a robot group", takes_time=True)
    def delete(self, slug: str) -> None:
        """Its robots stay; roles, courses and policies by it end."""
        services.group_delete(group=self.group(slug), actor=self.staff())


class GroupRoleView(GroupsBase):
    @manages("groups_role_set", "Give a person a role on a group’s robots", takes_time=True)
    def put(self, slug: str, username: str, body: RoleRequest) -> Holder:
        """For staff."""
        group, person = self.group(slug), account_named(username)
        services.group_role_set(group=group, user=person, role=Role(body.role), actor=self.staff())
        return Holder(person.username, body.role)

    @manages("groups_role_remove", "Take a person’s role on a group’s robots away", takes_time=True)
    def delete(self, slug: str, username: str) -> None:
        """Roles by courses and on single robots stay."""
        group, person = self.group(slug), account_named(username)
        services.group_role_set(group=group, user=person, role=None, actor=self.staff())


class RobotRolesView(SetupView):
    tag = "registry"

    @manages("registry_role_set", "Give a person a role on a robot", takes_time=True)
    def put(self, slug: str, username: str, body: RoleRequest) -> Holder:
        """For staff."""
        staff, robot, person = self.staff(), self.robot(slug), account_named(username)
        services.role_set(robot=robot, user=person, role=Role(body.role), actor=staff)
        return Holder(person.username, body.role)

    @manages("registry_role_remove", "Take a person’s role on a robot away", takes_time=True)
    def delete(self, slug: str, username: str) -> None:
        """Roles by courses and groups stay."""
        staff, robot, person = self.staff(), self.robot(slug), account_named(username)
        services.role_set(robot=robot, user=person, role=None, actor=staff)


class QualificationsBase(SetupView):
    """Base of the views of qualifications: as for groups."""

    tag = "groups"

    def concerned(
        self, slug: str = "", body: QualificationRequest | None = None, **_asked: Any
    ) -> list[Robot]:
        """Return the robots that demand the qualification now, and those that will."""
        found = _demanding(self.qualification(slug)) if slug else []
        if body is not None:
            found += self.named_robots(body.robots)
            for group in named_groups(body.groups):
                self.require_served(group.robots.all())  # also of an empty group: robots may be added later
        return found

    def qualification(self, slug: str) -> Qualification:
        """Return a qualification. Raises `Problem`: not found, not staff, or not served by the token."""
        self.staff()
        found = get_object_or_404(Qualification, slug=slug)
        self.require_served(_demanding(found))
        return found

    def save_qualification(self, entry: Qualification, body: QualificationRequest) -> None:
        """Save a qualification. Raises `Problem`."""
        robots, groups = self.named_robots(body.robots), named_groups(body.groups)
        entry.name, entry.description = body.name, body.description
        entry.slug = entry.slug or free_slug(Qualification, body.name)
        with faults_named():
            services.qualification_save(qualification=entry, robots=robots, groups=groups, actor=self.staff())


class QualificationsView(QualificationsBase):
    @manages("qualifications_list", "List qualifications", refuses=())
    def get(self) -> QualificationList:
        """For staff."""
        self.staff()
        found = Qualification.objects.prefetch_related("robots", "groups__robots")
        return QualificationList([_qualification(one) for one in found if self.serves(_demanding(one))])

    @makes(
        "qualifications_make", "Make a qualification", takes_time=True, answer=QualificationDetail, keyed=True
    )
    def post(self, body: QualificationRequest) -> Response:
        """For staff. From now on only people who hold it drive these robots."""
        self.staff()
        entry = Qualification()
        self.save_qualification(entry, body)
        return self.tagged(_qualification(entry), 201, f"/api/v1/qualifications/{entry.slug}")


class QualificationView(QualificationsBase):
    @manages("qualifications_read", "Read a qualification", answer=QualificationDetail)
    def get(self, slug: str) -> Response:
        """For staff."""
        return self.tagged(_qualification(self.qualification(slug)))

    @edits("qualifications_change", "Change a qualification", takes_time=True, answer=QualificationDetail)
    def put(self, slug: str, body: QualificationRequest) -> Response:
        """For staff. People who lack it lose control of robots that demand it now."""
        with transaction.atomic():
            entry = locked(self.qualification(slug))
            self.require_unchanged(_qualification(entry))
            self.save_qualification(entry, body)
        return self.tagged(_qualification(self.qualification(slug)))

    @manages("qualifications_delete", "Delete a qualification")
    def delete(self, slug: str) -> None:
        """No robot demands it any more, and nobody holds it."""
        services.qualification_delete(qualification=self.qualification(slug), actor=self.staff())


def account_named(username: str) -> User:
    """Return the open account with this name. Raises `Problem`."""
    found = User.objects.filter(username=username.replace("\0", ""), is_active=True).first()
    if found is None:
        raise Problem(_NO_ACCOUNT)
    return found


def _demanding(entry: Qualification) -> list[Robot]:
    """Return the robots that demand a qualification, directly or by a group."""
    return [*entry.robots.all(), *(robot for group in entry.groups.all() for robot in group.robots.all())]


def _group(group: RobotGroup) -> GroupEntry:
    roles = GroupRole.objects.filter(group=group).select_related("user").order_by("user__username")
    return GroupEntry(
        group.slug,
        group.name,
        sorted(robot.slug for robot in group.robots.all()),
        [Holder(one.user.username, one.role) for one in roles],  # type: ignore[arg-type]  # only these roles are given
    )


def _qualification(entry: Qualification) -> QualificationDetail:
    return QualificationDetail(
        entry.slug,
        entry.name,
        entry.description,
        sorted(robot.slug for robot in entry.robots.all()),
        sorted(group.slug for group in entry.groups.all()),
    )
