"""The registration of robots, for staff."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any

from django.db import transaction
from msgspec import UNSET, Meta, Struct, UnsetType, structs
from rest_framework.response import Response

from fleet.accounts.models import User
from robots.registry.models import Robot, RobotProfile
from robots.registry.selectors import free_slug
from robots.registry.services import robot_save
from robots.shared.configuration.robot_ros import Discovery as Search
from robots.shared.wire import Refusal
from teleop.api.v1.framework.operation import entry_of
from teleop.api.v1.framework.parameters import Time
from teleop.api.v1.framework.problems import Problem
from teleop.api.v1.setup.base import SetupView, edits, faults_named, locked, makes, manages

Name = Annotated[str, Meta(min_length=1, max_length=80)]
Address = Annotated[str, Meta(max_length=200)]
Domain = Annotated[int, Meta(ge=0, le=101)]
Peers = Annotated[str, Meta(max_length=400)]
Namespace = Annotated[str, Meta(max_length=100)]
Room = Annotated[str, Meta(max_length=120)]
Part = Annotated[float, Meta(ge=0.05, le=1.0)]

# Another value leads to another robot
ELSEWHERE = ("master_uri", "domain_id", "discovery", "static_peers", "discovery_server", "namespace")
_NO_PROFILE = Refusal("invalid", "There is no profile with this slug.", "wire")


class Registration(Struct, frozen=True):
    """A robot as it is registered."""

    slug: str
    name: str
    profile: str
    ros: int  # 1 or 2, its profile's: a robot with 1 is reached by its master, one with 2 in a domain
    master_uri: str
    advertised_address: str  # address at which the robot reaches this computer; empty: the console finds it
    domain_id: int
    discovery: Search
    static_peers: str  # addresses, with spaces between them
    discovery_server: str  # host:port; empty: there is none
    namespace: str  # such as /tiago1; empty: there is none
    room: str  # where people find it
    enabled: bool
    practice: bool
    default_share: float | None  # null: the profile's
    max_share: float
    updated_at: Time


class RegisterRequest(Struct, frozen=True, forbid_unknown_fields=True):
    """A new robot. The rest is as its profile says, and changed in the admin."""

    name: Name
    profile: str  # slug
    master_uri: Address = ""  # a robot with ROS 1 needs it
    slug: Annotated[str, Meta(pattern=r"^[a-z0-9-]{1,50}$")] | None = None  # null: made from the name
    advertised_address: Address = ""
    domain_id: Domain = 0
    discovery: Search = "subnet"
    static_peers: Peers = ""
    discovery_server: Address = ""
    namespace: Namespace = ""
    room: Room = ""
    enabled: bool = True


class RegistrationChange(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Fields that are left out stay as they are."""

    name: Name | UnsetType = UNSET
    master_uri: Address | UnsetType = UNSET
    advertised_address: Address | UnsetType = UNSET
    domain_id: Domain | UnsetType = UNSET
    discovery: Search | UnsetType = UNSET
    static_peers: Peers | UnsetType = UNSET
    discovery_server: Address | UnsetType = UNSET
    namespace: Namespace | UnsetType = UNSET
    room: Room | UnsetType = UNSET
    enabled: bool | UnsetType = UNSET
    default_share: Part | UnsetType | None = UNSET  # null: the profile's
    max_share: Part | UnsetType = UNSET


class RegistryView(SetupView):
    """Base of the views of registrations."""

    tag = "registry"

    def answer(self, robot: Robot, status: int = 200) -> Response:
        """Return the response with a registration and its ETag."""
        return self.tagged(_entry(robot), status)


class RegisterView(RegistryView):
    @makes("registry_add", "Register a robot", answer=Registration, refuses=(), keyed=True)
    def post(self, body: RegisterRequest) -> Response:
        """For staff. A bridge is started for it; `GET /robots/{slug}` says how it is. No token that is bound to robots
        serves the new one."""
        staff = self.staff()
        profile = RobotProfile.objects.filter(slug=body.profile).first()
        if profile is None:
            raise Problem(_NO_PROFILE)
        fields = _typed(body)
        del fields["slug"], fields["profile"]
        robot = Robot(slug=body.slug or free_slug(Robot, body.name), profile=profile, **fields)
        return self.answer(_saved(robot, staff), 201)


class RegistrationView(RegistryView):
    def concerned(self, slug: str, body: RegistrationChange, **_asked: Any) -> Iterable[Robot]:
        """Return the robot of the address; reached elsewhere it is another robot, which no bound token serves."""
        moved = any(getattr(body, name) is not UNSET for name in ELSEWHERE)
        return () if moved else [self.robot(slug)]

    @manages("registry_read", "Read a registration", answer=Registration)
    def get(self, slug: str) -> Response:
        """For staff."""
        self.staff()
        return self.answer(self.robot(slug))

    @edits("registry_change", "Change a registration", takes_time=True, answer=Registration)
    def patch(self, slug: str, body: RegistrationChange) -> Response:
        """For staff. The bridge is started again where that is needed."""
        staff, found = self.staff(), self.robot(slug)
        with transaction.atomic():
            robot = locked(found)
            self.require_unchanged(_entry(robot))
            for name, value in _typed(body).items():
                setattr(robot, name, value)
            saved = _saved(robot, staff)
        return self.answer(saved)


def _typed(body: Struct) -> dict[str, Any]:
    """Return the given fields; texts without spaces around them, as forms take them."""
    given = {name: value for name, value in structs.asdict(body).items() if value is not UNSET}
    return {name: value.strip() if isinstance(value, str) else value for name, value in given.items()}


def _saved(robot: Robot, staff: User) -> Robot:
    with faults_named():
        return robot_save(robot=robot, actor=staff)


def _entry(robot: Robot) -> Registration:
    return entry_of(Registration, robot, profile=robot.profile.slug, ros=robot.profile.ros)
