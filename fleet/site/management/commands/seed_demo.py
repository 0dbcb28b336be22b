"""``manage.py seed_demo FILE``: the simulated robots and accounts of script/demo.

FILE is JSON: {"robots": [{"slug", "name", "master_uri", or "domain_id" and "discovery" of a robot with ROS 2,
"advertised_address", "stick", "rear_camera", "camera"}],
"accounts": [{"username", "role", "password"}]}, and optionally "students" for `seed_demo_week`.
A new robot gets a small allow-list for practice. A second run updates only the robots' masters and domains.
Prints {slug: path of the bridge's socket}.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from django.core.management import call_command
from django.core.management.base import BaseCommand, CommandParser
from django.db import transaction
from django.utils import timezone
from msgspec import Struct, structs
from msgspec.json import decode

from fleet.accounts.models import User
from fleet.audit.command_line import here
from robots.access.services import role_set
from robots.places.entries import entry_of
from robots.places.models import SharedMap
from robots.places.services import map_name, places_import
from robots.registry.maps import map_store
from robots.registry.models import Allowance, Robot, RobotProfile, Role
from robots.registry.selectors import link_address
from robots.registry.services import entry_save, robot_save
from robots.shared.configuration.bridge_config import Allowed
from robots.shared.geometry.poses import Pose
from robots.shared.maps.occupancy import of_percents
from robots.simulator.physics.mujoco_world import Physics
from robots.simulator.physics.mujoco_world import Pose as Start
from robots.simulator.sensors.body import BODIES
from robots.simulator.sensors.survey import RESOLUTION_M, surveyed
from robots.simulator.worlds import load_world

PROFILE, PROFILE_2 = "tiago", "tiago-ros2"  # the second with ROS 2
WORLD = "office"  # the world in which script/stack starts the simulators
ALLOWED_BOTH = (
    Allowed("choose", "/phone_vel", use="drive"),
    Allowed("call", "/fleet/clients/add_two_ints", "rospy_tutorials/AddTwoInts"),
    Allowed("call", "/fleet/clients/fibonacci", "actionlib_tutorials/FibonacciAction"),
)
ALLOWED = (
    *ALLOWED_BOTH,
    Allowed("publish", "/fleet_demo/notes", "std_msgs/String"),
    Allowed("publish", "/fleet_demo/place", "geometry_msgs/PoseStamped"),
    Allowed("call", "/play_motion/list_motions", "play_motion_msgs/ListMotions"),
    Allowed("set", "/fleet_demo/greeting"),
)
ALLOWED_2 = (
    *ALLOWED_BOTH,
    Allowed("publish", "/fleet_demo/notes", "std_msgs/msg/String"),
    Allowed("publish", "/fleet_demo/place", "geometry_msgs/msg/PoseStamped"),
    Allowed("call", "/play_motion2/list_motions", "play_motion2_msgs/srv/ListMotions"),
)


REAR_CAMERA = {
    "name": "rear",
    "label": "Rear camera",
    "topic": "/rear_camera/image_raw",
    "type": "sensor_msgs/Image",
    "info": "/rear_camera/camera_info",
}
REAR_CAMERA_2 = REAR_CAMERA | {"type": "sensor_msgs/msg/Image"}


class PracticeRobot(Struct, frozen=True):
    """A robot of FILE."""

    slug: str
    name: str
    master_uri: str | None = None
    domain_id: int | None = None  # of a robot with ROS 2, which has no master
    discovery: str = "localhost"
    advertised_address: str = ""
    stick: list[Any] | None = None
    rear_camera: bool = False
    camera: bool = True


class Account(Struct, frozen=True):
    """An account of FILE."""

    username: str
    role: str
    password: str


class Plan(Struct, frozen=True):
    """The content of FILE."""

    robots: list[PracticeRobot]
    accounts: list[Account]
    students: list[dict[str, str]] = []


class Command(BaseCommand):
    help = "Register the simulated robots and accounts of script/demo."
    requires_system_checks = []  # the demo's supervisor runs the checks

    def add_arguments(self, parser: CommandParser) -> None:
        parser.add_argument("file", type=Path)

    def handle(self, *args: Any, **options: Any) -> None:
        """Seed in one transaction."""
        plan = decode(options["file"].read_bytes(), type=Plan)
        with transaction.atomic():
            robots = [seed_robot(robot) for robot in plan.robots]
            for account in plan.accounts:
                seed_account(account, robots)
            if robots:
                seed_map(robots)
        if plan.students:
            call_command("seed_demo_week", options["file"])
        self.stdout.write(json.dumps({robot.slug: link_address(robot).unix_path for robot in robots}))


def seed_robot(planned: PracticeRobot) -> Robot:
    """Register a simulated robot, or update the master of a registered one."""
    robot = Robot.objects.filter(slug=planned.slug).first()
    if robot is not None:
        for field, value in _reached(planned).items():
            setattr(robot, field, value)
        return robot_save(robot=robot, actor=here())
    profile = RobotProfile.objects.get(slug=PROFILE if planned.domain_id is None else PROFILE_2)
    cameras = [
        *(profile.topics["cameras"] if planned.camera else []),
        *([REAR_CAMERA if planned.domain_id is None else REAR_CAMERA_2] if planned.rear_camera else []),
    ]
    robot = Robot(
        slug=planned.slug,
        name=planned.name,
        profile=profile,
        practice=True,
        advertised_address=planned.advertised_address,
        **_reached(planned),
        stick=planned.stick,
        overrides={} if cameras == profile.topics["cameras"] else {"topics": {"cameras": cameras}},
    )
    robot_save(robot=robot, actor=here())
    for allowed in ALLOWED if planned.domain_id is None else ALLOWED_2:
        entry_save(entry=Allowance(robot=robot, **structs.asdict(allowed)), actor=here())
    return robot


def _reached(planned: PracticeRobot) -> dict[str, Any]:
    """Return the fields by which the robot is reached, which may change from run to run."""
    if planned.domain_id is None:
        return {"master_uri": planned.master_uri}
    return {"domain_id": planned.domain_id, "discovery": planned.discovery}


def seed_map(robots: list[Robot]) -> None:
    """Store the simulated robots' map of their world, and its places, unless a name or places are stored already."""
    world, body = load_world(WORLD), BODIES[PROFILE]
    x, y, _ = world.starts[0]
    survey = surveyed(Physics(world, body, Start(x, y, 0.0)), world.size, body.laser.pose[2])
    taken = of_percents(RESOLUTION_M, Pose(survey.west_m, survey.south_m, 0.0), survey.cells)
    for robot in robots:
        map_store(robot.id, taken, timezone.now())
    if SharedMap.objects.filter(digest=taken.digest).exists():
        return
    places = [entry_of(place.name, *place.at, math.radians(place.heading)) for place in world.places]
    map_name(digest=taken.digest, name=world.name.capitalize(), actor=here())
    places_import(digest=taken.digest, entries=dict(enumerate(places, start=1)), actor=here())


def seed_account(planned: Account, robots: list[Robot]) -> None:
    """Create an account, if it does not exist, with its role on every simulated robot."""
    if User.objects.filter(username=planned.username).exists():
        return
    is_staff = planned.role == Role.STAFF
    user = User.objects.create_user(
        planned.username,
        password=planned.password,
        full_name=planned.username.capitalize(),
        is_staff=is_staff,
        is_superuser=is_staff,
    )
    if not is_staff:
        for robot in robots:
            role_set(robot=robot, user=user, role=Role(planned.role), actor=here())
